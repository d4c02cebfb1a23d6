// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/test_bars.h"

#include <cstdint>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"

namespace tissueform::benchmarks {

absl::StatusOr<TestBar> MakeTestBar(int number) {
  const std::array<int, 3>& cells = kBars[static_cast<size_t>(number - 1)];
  TF_ASSIGN_OR_RETURN(TetMesh mesh, BarMesh(CubeGrid(cells, 1)));
  // Vertices are numbered layer by layer along z.
  std::vector<int32_t> lowest(static_cast<size_t>((cells[0] + 1) * (cells[1] + 1)));
  std::vector<int32_t> highest(lowest.size());
  std::iota(lowest.begin(), lowest.end(), 0);
  std::iota(highest.begin(), highest.end(),
            static_cast<int32_t>(mesh.num_vertices()) - static_cast<int32_t>(highest.size()));
  TF_ASSIGN_OR_RETURN(ConstraintSet ends, ConstraintSet::Create(mesh, std::move(lowest),
                                                                {{"end", std::move(highest)}}));
  Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(mesh.num_tets());
  return TestBar{number, absl::StrCat(cells[0], "x", cells[1], "x", cells[2]), std::move(mesh),
                 std::move(stiffness), std::move(ends)};
}

std::vector<HandlePose> SidewaysPose(const TestBar& bar) {
  HandlePose pose;
  pose.translation_mm.x() = bar.mesh.positions().col(2).maxCoeff() / 3;
  return {pose};
}

double SidewaysTolerance(const TestBar& bar) {
  return 1e-3 * SidewaysPose(bar).front().translation_mm.norm();
}

}  // namespace tissueform::benchmarks
