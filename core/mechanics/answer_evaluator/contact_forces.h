// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <vector>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// The forces of unilateral contact as further factors of the columns: with a the coefficients of
// the poses, gaps of q = gap_map a + gaps without contact, and forces l >= 0 of the LCP g = q +
// compliance l >= 0, l g = 0 (LcpSolver).
//
// Thread-safe. Forces do not depend on what was asked before.
class ContactForces {
 public:
  // `answers` may move, but their sections must outlive it and stay where they are. Without contact
  // rows it does nothing.
  explicit ContactForces(const PortableAnswers& answers);
  ContactForces(ContactForces&&) noexcept;
  ContactForces& operator=(ContactForces&&) noexcept;
  ~ContactForces();

  // Appends the forces in Pa mm^2 to `factors`, which are a. Returns by how many mm the gaps miss
  // the conditions at most; infinite where no forces were found.
  double Append(const PortableAnswers& answers, std::vector<double>* factors) const;

 private:
  struct Spare;  // a solver that is free

  std::unique_ptr<Spare> spare_;
};

}  // namespace tissueform
