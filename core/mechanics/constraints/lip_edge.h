// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/contact_row.h"

namespace tissueform {

// The front edge of two parted lips that are closed at rest: where a seal may hold them together.
struct LipEdge {
  struct Pair {
    int32_t upper = 0;
    int32_t lower = 0;  // at the same place at rest

    friend bool operator==(const Pair&, const Pair&) = default;
  };

  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // of length 1, from the lower lip to the upper
  std::vector<Pair> pairs;

  friend bool operator==(const LipEdge&, const LipEdge&) = default;
};

// InvalidArgument, naming the pair by its index and saying what to do, unless
//  * `up` has length 1 within 1e-6 and there is a pair;
//  * the vertices lie in [0, #V) and each is in one pair only;
//  * the two of a pair are at exactly one place in `rest` (#V) and one of `rows` is between them.
absl::Status CheckLipEdge(const LipEdge& edge, const Positions& rest,
                          const std::vector<ContactRow>& rows);

}  // namespace tissueform
