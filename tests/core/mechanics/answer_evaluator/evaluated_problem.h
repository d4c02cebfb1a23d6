// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "tests/testing/handle_problem.h"

namespace tissueform::testing {

inline std::string NameOf(DeformationModel model) {
  switch (model) {
    case DeformationModel::kLinearElastic:
      return "linear_elastic";
    case DeformationModel::kNeoHookean:
      return "neo_hookean";
    default:
      return "gradient_field";
  }
}

// What is evaluated: of neo_hookean one handle has a third order, several have not.
struct Evaluated {
  std::string name;
  DeformationModel model;
  int num_handles;
  bool touches = false;  // with contact rows
  uint32_t version = 1;  // of the bytes
};

// PrepareMesh; where the mesh touches, one wall of it slides on fixed bone, and a second one may
// lift off fixed bone and that of the first handle in turn.
inline std::shared_ptr<MeshPreparation> PrepareEvaluated(const TetMesh& mesh,
                                                         const Evaluated& evaluated) {
  if (!evaluated.touches) return PrepareMesh(mesh, evaluated.num_handles);
  const ConstraintSet regions = StackedHandles(mesh, evaluated.num_handles);
  const Eigen::RowVector3d low = mesh.positions().colwise().minCoeff();
  const Eigen::RowVector3d thin = 0.1 * (mesh.positions().colwise().maxCoeff() - low);
  std::vector<ContactRow> rows;
  for (int32_t v = 0; v < mesh.num_vertices(); ++v) {
    const Eigen::RowVector3d place = mesh.positions().row(v) - low;
    if (std::ranges::binary_search(regions.constrained(), v)) continue;
    if (place.x() < thin.x()) {
      rows.push_back(
          {.vertex = v, .normal = Eigen::Vector3d(1, 0.2, 0).normalized(), .bilateral = true});
    } else if (place.y() < thin.y()) {
      rows.push_back({.vertex = v,
                      .handle = v % 2 - 1,
                      .normal = Eigen::Vector3d::UnitY(),
                      .gap_mm = v % 3 * 0.02});
    }
  }
  return *MeshPreparation::Create(
      mesh, MixedStiffness(mesh.num_tets()),
      *ConstraintSet::Create(mesh, regions.fixed(), regions.handles(), std::move(rows)), {});
}

inline const std::vector<Evaluated>& EvaluatedModels() {
  static const auto* const models = new std::vector<Evaluated>{
      {"gradient_field", DeformationModel::kGradientField, 2},
      {"linear_elastic", DeformationModel::kLinearElastic, 2},
      {"linear_elastic_contact", DeformationModel::kLinearElastic, 2, true, 3},
      {"neo_hookean", DeformationModel::kNeoHookean, 2},
      {"neo_hookean_third_order", DeformationModel::kNeoHookean, 1, false, 2}};
  return *models;
}

inline std::vector<AnswerPose> ToAnswerPoses(const std::vector<HandlePose>& poses) {
  std::vector<AnswerPose> converted;
  for (const HandlePose& pose : poses) {
    AnswerPose& to = converted.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      to.rotation_vector[axis] = pose.rotation_vector[axis];
      to.pivot_mm[axis] = pose.pivot_mm[axis];
      to.translation_mm[axis] = pose.translation_mm[axis];
    }
    to.scale = pose.scale;
  }
  return converted;
}

// Handles turned about points near their middle and moved, anything up to a part of the mesh's
// size; every third pose turns so far that most models do not cover it.
inline std::vector<HandlePose> DragPoses(const MeshPreparation& preparation, DeformationModel model,
                                         int number, RandomNumbers* random) {
  const double size_mm = preparation.mesh().BoundingBoxDiagonal();
  const double part = std::abs(random->Next());
  const double most_rad = number % 3 == 2 ? 0.6 : 0.5;
  std::vector<HandlePose> poses;
  for (const HandleRegion& handle : preparation.constraints().handles()) {
    HandlePose& pose = poses.emplace_back();
    const Eigen::Vector3d middle =
        preparation.mesh().positions()(handle.vertices, Eigen::all).colwise().mean();
    pose.pivot_mm = middle + 0.05 * size_mm * random->Vector();
    pose.rotation_vector = part * most_rad * random->Vector().normalized();
    pose.translation_mm = 0.05 * part * size_mm * random->Vector();
    if (model != DeformationModel::kNeoHookean) pose.scale = 1 + 0.05 * random->Next();
  }
  return poses;
}

}  // namespace tissueform::testing
