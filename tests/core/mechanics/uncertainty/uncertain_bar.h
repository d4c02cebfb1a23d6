// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// A jittered bar of three tissues, layers along x, whose upper end is turned and moved.
struct UncertainBar {
  explicit UncertainBar(DeformationModel chosen, double poisson_ratio = 0.45)
      : model(chosen),
        mesh(Bar({4, 3, 6}, 2.0, 0.15)),
        constraints(StackedHandles(mesh, 1)),
        stiffness(mesh.num_tets()),
        poisson(poisson_ratio) {
    for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
      const double x = mesh.positions()(mesh.tets().row(t), 0).mean();
      const int32_t tissue = x < 2.5 ? 0 : (x < 5 ? 1 : 2);
      uncertainty.tissue_of_tet.push_back(tissue);
      stiffness[t] = std::array{16000.0, 27000.0, 53000.0}[static_cast<size_t>(tissue)];
    }
    uncertainty.tissues = {{"fat", 2}, {"muscle", 1.5}, {"dense", 2}};
    HandlePose& pose = poses.emplace_back();
    pose.rotation_vector = {0.1, 0.05, -0.15};
    pose.pivot_mm = {4, 3, 12};
    pose.translation_mm = {0.6, -0.8, 0.4};
  }

  double Sigma(int tissue) const {
    return std::log(uncertainty.tissues[static_cast<size_t>(tissue)].factor_95) / kNormal95;
  }

  std::shared_ptr<MeshPreparation> Prepare() const { return Prepare(stiffness, poisson); }
  std::shared_ptr<MeshPreparation> Prepare(const Eigen::VectorXd& pa, double ratio) const {
    PreparationOptions options;
    options.poisson_ratio = ratio;
    return *MeshPreparation::Create(mesh, pa, constraints, options);
  }

  // The answer in full with variables z of AnswerExpansion for the tissues.
  Positions Solve(const Eigen::VectorXd& z, double ratio) const {
    Eigen::VectorXd changed = stiffness;
    for (Eigen::Index t = 0; t < changed.size(); ++t) {
      const int tissue = uncertainty.tissue_of_tet[static_cast<size_t>(t)];
      changed[t] *= std::exp(Sigma(tissue) * z[tissue]);
    }
    DeformerOptions options;
    options.model = model;
    options.neo_hookean.tolerance = 1e-9;
    auto deformer = *CreateDeformer(Prepare(changed, ratio), options);
    return deformer->Deform(poses)->positions;
  }
  Positions Solve(const Eigen::VectorXd& z) const { return Solve(z, poisson); }
  Positions Solve() const { return Solve(Eigen::VectorXd::Zero(3)); }

  DeformationModel model;
  TetMesh mesh;
  ConstraintSet constraints;
  Eigen::VectorXd stiffness;
  double poisson;
  MaterialUncertainty uncertainty;
  std::vector<HandlePose> poses;
};

// Of #V by 3, the unknowns 3 v + axis.
inline Eigen::VectorXd Flat(const Positions& rows) {
  return Eigen::Map<const Eigen::VectorXd>(rows.data(), rows.size());
}

}  // namespace tissueform::testing
