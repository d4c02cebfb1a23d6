// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/contact_cases.h"

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "client/lab/accuracy/accuracy_models.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"

namespace tissueform {
namespace {

constexpr double kBlockPa = 15000;
constexpr double kTop = 3.75;  // of the block under the plate, mm

std::vector<int32_t> VerticesAtHeight(const TetMesh& mesh, double height_mm) {
  std::vector<int32_t> vertices;
  for (int32_t v = 0; v < mesh.num_vertices(); ++v) {
    if (mesh.positions()(v, 2) == height_mm) vertices.push_back(v);
  }
  return vertices;
}

AccuracyCase CaseOf(std::string name, const TetMesh& mesh, ConstraintSet constraints,
                    const HandlePose& pose) {
  return {
      std::move(name),        "",     mesh, Eigen::VectorXd::Constant(mesh.num_tets(), kBlockPa),
      std::move(constraints), {pose}, {}};
}

}  // namespace

absl::StatusOr<AccuracyCase> WithContactRows(const AccuracyCase& problem) {
  const ConstraintSet& regions = problem.constraints;
  const auto thin = [&](const std::vector<int32_t>& vertices, size_t step, const ContactRow& like,
                        std::vector<ContactRow>* rows) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const int32_t v : vertices) middle += problem.mesh.positions().row(v);
    middle /= static_cast<double>(vertices.size());
    std::vector<int32_t> left;
    for (size_t i = 0; i < vertices.size(); ++i) {
      if (i % step != 0) {
        left.push_back(vertices[i]);
        continue;
      }
      ContactRow& row = rows->emplace_back(like);
      row.vertex = vertices[i];
      row.normal = (problem.mesh.positions().row(row.vertex) - middle).normalized();
      if (!row.bilateral && i % 2 == 0) row.gap_mm = 0.05;
    }
    return left;
  };
  std::vector<ContactRow> rows;
  std::vector<HandleRegion> handles = regions.handles();
  handles[0].vertices = thin(handles[0].vertices, 2, {.handle = 0, .bilateral = true}, &rows);
  std::vector<int32_t> fixed = thin(regions.fixed(), 6, {}, &rows);
  AccuracyCase with = problem;
  TF_ASSIGN_OR_RETURN(with.constraints, ConstraintSet::Create(problem.mesh, std::move(fixed),
                                                              std::move(handles), std::move(rows)));
  return with;
}

absl::StatusOr<AccuracyCase> TwoBlocks() {
  TF_ASSIGN_OR_RETURN(const TetMesh block, BarMesh(CubeGrid({6, 6, 8}, 0.5)));
  const auto vertices = static_cast<int32_t>(block.num_vertices());
  Positions positions(2 * vertices, 3);
  positions << block.positions(), block.positions().rowwise() + Eigen::RowVector3d(0, 0, 4);
  TetIndices tets(2 * block.num_tets(), 4);
  tets << block.tets(), (block.tets().array() + vertices).matrix();
  TF_ASSIGN_OR_RETURN(const TetMesh mesh, TetMesh::Create(positions, tets));
  std::vector<ContactRow> rows;
  for (int32_t v = 0; v < vertices; ++v) {
    for (int32_t w = vertices; w < 2 * vertices && positions(v, 2) == 4; ++w) {
      if (positions.row(v) != positions.row(w)) continue;
      rows.push_back({.vertex = w, .other = v, .normal = Eigen::Vector3d::UnitZ()});
    }
  }
  HandlePose pose;
  pose.rotation_vector = {0.08, 0, 0};
  pose.pivot_mm = {1.5, 1.5, 8};
  pose.translation_mm = {0.03, 0.02, -0.1};
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ConstraintSet::Create(mesh, VerticesAtHeight(mesh, 0),
                                            {{"top", VerticesAtHeight(mesh, 8)}}, rows));
  return CaseOf("two_blocks", mesh, std::move(constraints), pose);
}

CalculixProblem TwoBlocksForCalculix(const AccuracyCase& problem) {
  CalculixProblem of_calculix = ForCalculix(problem, kBlockPoissonRatio, CalculixLaw::kLinear);
  of_calculix.forces_and_stresses = true;
  of_calculix.contact = CalculixContact::kSurfaces;
  return of_calculix;
}

absl::StatusOr<AccuracyCase> BlockUnderPlate() {
  TF_ASSIGN_OR_RETURN(const TetMesh block, BarMesh(CubeGrid({4, 4, 5}, 0.75)));
  TF_ASSIGN_OR_RETURN(const TetMesh plate, BarMesh(CubeGrid({9, 9, 2}, 0.75)));
  const auto vertices = static_cast<int32_t>(block.num_vertices());
  Positions positions(vertices + plate.num_vertices(), 3);
  positions << block.positions(),
      plate.positions().rowwise() + Eigen::RowVector3d(-1.875, -1.875, kTop);
  TetIndices tets(block.num_tets() + plate.num_tets(), 4);
  tets << block.tets(), (plate.tets().array() + vertices).matrix();
  TF_ASSIGN_OR_RETURN(const TetMesh mesh, TetMesh::Create(positions, tets));
  std::vector<ContactRow> rows;
  std::vector<int32_t> bottom;
  for (int32_t v = 0; v < vertices; ++v) {
    if (positions(v, 2) == 0) bottom.push_back(v);
    if (positions(v, 2) == kTop) {
      rows.push_back({.vertex = v, .handle = 0, .normal = -Eigen::Vector3d::UnitZ()});
    }
  }
  std::vector<int32_t> of_plate(static_cast<size_t>(plate.num_vertices()));
  std::iota(of_plate.begin(), of_plate.end(), vertices);
  HandlePose pose;
  pose.rotation_vector = {0.2, -0.15, 0};
  pose.pivot_mm = {1.5, 1.5, kTop};
  pose.translation_mm = {0.7, 0.5, -0.45};
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ConstraintSet::Create(mesh, bottom, {{"plate", of_plate}}, rows));
  return CaseOf("block_under_plate", mesh, std::move(constraints), pose);
}

absl::StatusOr<CalculixProblem> BlockUnderPlateForCalculix(const AccuracyCase& problem) {
  const TetMesh& mesh = problem.mesh;
  const std::vector<int32_t>& plate = problem.constraints.handles()[0].vertices;
  std::vector<int32_t> upper;
  std::vector<int32_t> moved;
  for (const int32_t v : plate) {
    if (mesh.positions()(v, 2) == kTop) upper.push_back(v);
    if (mesh.positions()(v, 2) == kTop + 1.5) moved.push_back(v);
  }
  std::vector<ContactRow> rows;
  for (size_t i = 0; i < upper.size(); ++i) {
    const size_t like = i % problem.constraints.contact().size();
    rows.push_back({.vertex = upper[i],
                    .other = problem.constraints.contact()[like].vertex,
                    .normal = Eigen::Vector3d::UnitZ()});
  }
  Eigen::VectorXd stiffness = problem.stiffness;
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    if (mesh.tets().row(t).minCoeff() >= plate.front()) stiffness[t] *= 1e3;
  }
  TF_ASSIGN_OR_RETURN(
      const ConstraintSet constraints,
      ConstraintSet::Create(mesh, problem.constraints.fixed(), {{"plate", moved}}, rows));
  return CalculixProblem{mesh,
                         stiffness,
                         kBlockPoissonRatio,
                         constraints,
                         ConstrainedDisplacements(mesh, constraints, problem.poses),
                         CalculixLaw::kNeoHookean,
                         /*forces_and_stresses=*/true,
                         BoneMotions(mesh, constraints, problem.poses),
                         CalculixContact::kSurfaces};
}

}  // namespace tissueform
