// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// The neo-Hookean answer as a series in the poses' numbers n (SeriesTerms), of the second order, or
// of the third where there is one handle: three have 1,140 triples of numbers. With u1 the linear
// answer, which has the handles exactly where the poses put them, v1 and v2 what is linear and
// quadratic in n of it (A - I = n x + (n n^T - |n|^2 I) / 2 + O(n^4) for a turn), and f = K u +
// Q(u, u) + ... the forces about rest:
//   K u2 = -Q(v1, v1),   K u3 = -p(n),   both 0 on all constrained vertices,
// where p is the third order of the forces along t v1 + t^2 (v2 + u2) (ThirdOrderForces). The
// answer is u1 + u2 + u3 / (1 + q), see SeriesTerms and LengthsOf.
struct NeoHookeanSeries {
  // Displacements, mm, of the vertices asked for, 3 v + axis: the columns of the linear system,
  // then those of all pairs and triples, as they are counted in NumFieldPairs and NumFieldTriples.
  Eigen::MatrixXd columns;
  Eigen::MatrixXd linear;  // v1 of the same vertices, a unit of every number
  // LengthsOf both orders over all vertices; empty where the series ends with the second.
  std::vector<float> second_lengths;
  std::vector<float> third_lengths;
};

// How many columns of each order there are for the constraints' handles.
struct SeriesSizes {
  explicit SeriesSizes(const MeshPreparation& preparation);

  Eigen::Index numbers = 0;
  Eigen::Index linear = 0;
  Eigen::Index pairs = 0;
  Eigen::Index triples = 0;  // 0 where the series ends with the second order

  Eigen::Index columns() const { return linear + pairs + triples; }
};

// At most, while a series is made, beside its columns.
int64_t NeoHookeanSeriesBytes(const MeshPreparation& preparation);

// `elastic` is the preparation's own. Reports the columns to `observer`, which may be empty.
// Errors: those of ElasticSystem::Solve; Cancelled.
absl::StatusOr<NeoHookeanSeries> MakeNeoHookeanSeries(const MeshPreparation& preparation,
                                                      const ElasticSystem& elastic,
                                                      const std::vector<int32_t>& vertices,
                                                      const PreparationObserver& observer,
                                                      const Cancellation& cancellation);

}  // namespace tissueform
