// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_energy.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel_for.h"
#include "core/mechanics/elasticity/neo_hookean_batch.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kLanes = NeoHookeanBatch::kSize;
constexpr Eigen::Index kTetGrain = 32 * kLanes;
constexpr Eigen::Index kVertexGrain = 1024;

// Puts tet `tet` into a lane.
void LoadTet(const PiecewiseLinearElements& elements, const Positions& displacements,
             const Eigen::VectorXd& stiffness, Eigen::Index tet, Eigen::Index lane,
             NeoHookeanBatch* batch) {
  const int32_t* corners = elements.cells.data() + 4 * tet;
  const double* rest = elements.rest.data();
  const double* moved = displacements.data();
  const Eigen::Index origin = Eigen::Index{3} * corners[0];
  for (int a = 1; a < 4; ++a) {
    const Eigen::Index other = Eigen::Index{3} * corners[a];
    for (int i = 0; i < 3; ++i) {
      batch->rest_edges[3 * (a - 1) + i][lane] = rest[other + i] - rest[origin + i];
      batch->displacement_edges[3 * (a - 1) + i][lane] = moved[other + i] - moved[origin + i];
    }
  }
  batch->stiffness[lane] = stiffness[tet];
}

}  // namespace

NeoHookeanEnergy::NeoHookeanEnergy(const PiecewiseLinearElements& elements,
                                   const VertexCells& vertex_cells,
                                   const Eigen::VectorXd& stiffness, double poisson_ratio,
                                   int threads)
    : elements_(elements),
      vertex_cells_(vertex_cells),
      stiffness_(stiffness),
      unit_(ModuliOf(1.0, poisson_ratio)),
      threads_(threads),
      loads_(elements.num_cells(), 9),
      blocks_((elements.num_cells() + kTetGrain - 1) / kTetGrain) {}

NeoHookeanEnergy::Value NeoHookeanEnergy::Evaluate(const Positions& displacements,
                                                   Positions* gradient) {
  const Eigen::Index num_tets = elements_.num_cells();
  ParallelFor(threads_, num_tets, kTetGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index first = begin; first < end; first += kTetGrain) {
      blocks_[first / kTetGrain] =
          EvaluateTets(displacements, first, std::min(first + kTetGrain, num_tets));
    }
  });
  // Block after block, regardless of which thread computed which: the line search compares energies
  // to 1e-13, so their last digits must not depend on the threads.
  Value whole;
  whole.smallest_volume_ratio = std::numeric_limits<double>::infinity();
  for (const Value& block : blocks_) {
    whole.energy_nj += block.energy_nj;
    whole.inverted_tets += block.inverted_tets;
    whole.smallest_volume_ratio =
        std::min(whole.smallest_volume_ratio, block.smallest_volume_ratio);
  }
  // The gradient is not wanted then: the line search only shortens the step.
  if (whole.inverted_tets > 0) {
    whole.energy_nj = std::numeric_limits<double>::infinity();
    return whole;
  }
  GatherLoads(gradient);
  return whole;
}

NeoHookeanEnergy::Value NeoHookeanEnergy::EvaluateTets(const Positions& displacements,
                                                       Eigen::Index begin, Eigen::Index end) {
  NeoHookeanBatch batch;
  Value value;
  value.smallest_volume_ratio = std::numeric_limits<double>::infinity();
  for (Eigen::Index first = begin; first < end; first += kLanes) {
    for (Eigen::Index lane = 0; lane < kLanes; ++lane) {
      // The last tet fills the lanes behind it: they are computed and left out below.
      LoadTet(elements_, displacements, stiffness_, std::min(first + lane, end - 1), lane, &batch);
    }
    EvaluateNeoHookean(unit_.shear, unit_.bulk, &batch);
    for (Eigen::Index lane = 0; lane < kLanes && first + lane < end; ++lane) {
      const double ratio = 1.0 + batch.volume_change[lane];
      const bool positive = ratio > 0 && std::isfinite(batch.energy[lane]);
      value.energy_nj += batch.energy[lane];
      value.inverted_tets += positive ? 0 : 1;
      value.smallest_volume_ratio = std::min(value.smallest_volume_ratio, ratio);
      double* loads = loads_.row(first + lane).data();
      for (int entry = 0; entry < 9; ++entry) {
        loads[entry] = batch.loads[entry][lane];
      }
    }
  }
  return value;
}

void NeoHookeanEnergy::GatherLoads(Positions* gradient) const {
  gradient->resize(elements_.num_vertices(), 3);
  ParallelFor(threads_, gradient->rows(), kVertexGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index v = begin; v < end; ++v) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (Eigen::Index k = vertex_cells_.begin(v); k < vertex_cells_.end(v); ++k) {
        const Eigen::Map<const Eigen::Matrix3d> loads(loads_.row(vertex_cells_.cell(k)).data());
        const int corner = vertex_cells_.corner(k);
        if (corner == 0) {
          sum -= loads.rowwise().sum();
        } else {
          sum += loads.col(corner - 1);
        }
      }
      gradient->row(v) = sum;
    }
  });
}

int64_t NeoHookeanEnergy::BytesNeeded(Eigen::Index num_tets) {
  return num_tets * static_cast<int64_t>(9 * sizeof(double)) +
         (num_tets / kTetGrain + 1) * static_cast<int64_t>(sizeof(Value));
}

}  // namespace tissueform
