// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/cotangent_weights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

struct EdgeWeight {
  std::array<int32_t, 2> edge;  // rising
  double weight;
  double magnitude;  // of what was summed up, for the rounding error
};

// With area vectors a_k of the facets opposite to corner k, grad phi_k = -a_k / (3 V), so that the
// weight V grad phi_i . grad phi_j with its sign turned is -a_i . a_j / (9 V). Not by
// core/mesh/operators, which lies above this folder, and from areas and volume: a flat tet, of
// which a cotangent has no value, is one test.
void AddTet(const TetMesh& mesh, Eigen::Index t, std::vector<EdgeWeight>* weights) {
  const auto tet = mesh.tets().row(t);
  std::array<Eigen::Vector3d, 4> corners;
  for (int k = 0; k < 4; ++k) corners[k] = mesh.positions().row(tet[k]).transpose();
  const double volume =
      (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]) / 6.0;
  std::array<Eigen::Vector3d, 4> areas;
  for (int k = 0; k < 4; ++k) {
    const auto& [a, b, c] = kTetFacets[k];
    areas[k] = 0.5 * (corners[b] - corners[a]).cross(corners[c] - corners[a]);
  }
  for (const auto& [i, j] : kTetEdges) {
    const double weight = volume == 0 ? 0 : -areas[i].dot(areas[j]) / (9.0 * volume);
    weights->push_back(
        {{std::min(tet[i], tet[j]), std::max(tet[i], tet[j])}, weight, std::abs(weight)});
  }
}

}  // namespace

CotangentWeightSigns CountNegativeCotangentWeights(const TetMesh& mesh) {
  // Right angles, as in every grid of cubes, sum up to zero only within rounding. Terms of both
  // signs cancel, so rounding is measured against their magnitudes and not against what is left of
  // them.
  constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();
  std::vector<EdgeWeight> weights;
  weights.reserve(6 * mesh.num_tets());
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) AddTet(mesh, t, &weights);
  // Stable: the terms of an edge are summed in the order of the tets, whichever way the library
  // sorts.
  std::stable_sort(weights.begin(), weights.end(),
                   [](const EdgeWeight& a, const EdgeWeight& b) { return a.edge < b.edge; });
  CotangentWeightSigns signs;
  for (size_t first = 0; first < weights.size();) {
    double sum = 0;
    double magnitude = 0;
    size_t next = first;
    for (; next < weights.size() && weights[next].edge == weights[first].edge; ++next) {
      sum += weights[next].weight;
      magnitude += weights[next].magnitude;
    }
    ++signs.num_edges;
    signs.num_negative += sum < -kRounding * magnitude ? 1 : 0;
    first = next;
  }
  return signs;
}

}  // namespace tissueform
