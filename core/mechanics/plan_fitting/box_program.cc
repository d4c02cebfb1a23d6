// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/box_program.h"

#include <algorithm>
#include <vector>

#include <Eigen/Cholesky>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

enum class Held { kNot, kAtLower, kAtUpper };

class BoxProgram {
 public:
  BoxProgram(const MatrixXd& H, const VectorXd& g, const VectorXd& lower, const VectorXd& upper)
      : H_(H),
        g_(g),
        lower_(lower),
        upper_(upper),
        d_(VectorXd::Zero(g.size())),
        bounds_(static_cast<size_t>(g.size()), Held::kNot) {
    for (Index i = 0; i < g.size(); ++i) {
      if (g[i] > 0 && lower[i] >= 0) bounds_[static_cast<size_t>(i)] = Held::kAtLower;
      if (g[i] < 0 && upper[i] <= 0) bounds_[static_cast<size_t>(i)] = Held::kAtUpper;
    }
  }

  VectorXd Solve() {
    // A variable may come and go; rounding may let two change places endlessly.
    const Index most_rounds = 20 * (g_.size() + 1);
    for (Index round = 0; round < most_rounds; ++round) {
      if (GoToMinimumOfFree() && !ReleaseOne()) break;
    }
    return d_;
  }

 private:
  // Whether it got there; otherwise one more variable is bound.
  bool GoToMinimumOfFree() {
    std::vector<Index> free;
    for (Index i = 0; i < g_.size(); ++i) {
      if (bounds_[static_cast<size_t>(i)] == Held::kNot) free.push_back(i);
    }
    if (free.empty()) return true;
    const MatrixXd H_free = H_(free, free);
    const VectorXd slope = (H_ * d_ + g_)(free);
    const VectorXd move = -H_free.ldlt().solve(slope);
    double share = 1;
    Index blocking = -1;
    for (Index k = 0; k < move.size(); ++k) {
      const Index i = free[static_cast<size_t>(k)];
      const double room = move[k] > 0 ? upper_[i] - d_[i] : lower_[i] - d_[i];
      if (move[k] != 0 && room / move[k] < share) {
        share = std::max(0.0, room / move[k]);
        blocking = k;
      }
    }
    d_(free) += share * move;
    if (blocking < 0) return true;
    const Index i = free[static_cast<size_t>(blocking)];
    const bool at_upper = move[blocking] > 0;
    d_[i] = at_upper ? upper_[i] : lower_[i];
    bounds_[static_cast<size_t>(i)] = at_upper ? Held::kAtUpper : Held::kAtLower;
    return false;
  }

  bool ReleaseOne() {
    const VectorXd slope = H_ * d_ + g_;
    const double negligible = 1e-14 * (1e-300 + g_.cwiseAbs().maxCoeff());
    double strongest = negligible;
    Index released = -1;
    for (Index i = 0; i < slope.size(); ++i) {
      const Held bound = bounds_[static_cast<size_t>(i)];
      const double pull = bound == Held::kAtLower   ? -slope[i]
                          : bound == Held::kAtUpper ? slope[i]
                                                    : 0;
      if (pull > strongest && lower_[i] < upper_[i]) {
        strongest = pull;
        released = i;
      }
    }
    if (released < 0) return false;
    bounds_[static_cast<size_t>(released)] = Held::kNot;
    return true;
  }

  const MatrixXd& H_;
  const VectorXd& g_;
  const VectorXd& lower_;
  const VectorXd& upper_;
  VectorXd d_;
  std::vector<Held> bounds_;
};

}  // namespace

VectorXd SolveBoxProgram(const MatrixXd& H, const VectorXd& g, const VectorXd& lower,
                         const VectorXd& upper) {
  return BoxProgram(H, g, lower, upper).Solve();
}

}  // namespace tissueform
