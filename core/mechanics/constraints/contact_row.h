// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include <Eigen/Core>

namespace tissueform {

// One condition of contact without friction, between tissue and bone or between two lips. The gap
// of a row in mm is
//
//   g = normal . (u(vertex) - u_other) + gap_mm,
//
// u being displacements and u_other that of the bone at the place where `vertex` rests, or of the
// vertex `other`. A bilateral row keeps g = 0: tissue slides along the bone and does not leave it.
// A unilateral row keeps g >= 0: tissue may lift off. The normals do not turn.
struct ContactRow {
  static constexpr int kFixedBone = -1;
  static constexpr int32_t kBone = -1;

  int32_t vertex = 0;       // a free vertex
  int32_t other = kBone;    // kBone, or the free vertex on the other lip
  int handle = kFixedBone;  // which bone: kFixedBone (it rests) or the index of a handle
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();  // of length 1, towards `vertex`
  double gap_mm = 0;                                  // at rest, at least 0
  bool bilateral = false;

  friend bool operator==(const ContactRow&, const ContactRow&) = default;
};

// Limits of one constraint set. Rows that may lift off are condensed to one dense matrix, and a
// pose takes as long as their active set; prepared answers (answer_checks.cc) have the same limit.
inline constexpr size_t kMaxContactRows = 16384;
inline constexpr size_t kMaxUnilateralRows = 1000;

// InvalidArgument, naming the row by its index and saying what to do, unless in every row
//  * the vertices lie in [0, #V), are not among `is_constrained` (#V) and differ;
//  * the handle is kFixedBone or in [0, num_handles), and kFixedBone between two lips;
//  * the normal has length 1 within 1e-6 and the gap is finite and not negative;
//  * a bilateral row is of bone, without a gap;
// and unless bilateral rows of one vertex are orthogonal within 1e-6, no two rows are the same but
// for their gap, and there are no more rows than the limits above.
absl::Status CheckContactRows(const std::vector<ContactRow>& rows,
                              const std::vector<bool>& is_constrained, int num_handles);

}  // namespace tissueform
