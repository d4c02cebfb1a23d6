// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Of lips that are asked to be sealed.
struct SealState {
  double parted_mm = 0;   // heights of the edges from each other at most, before they are sealed
  bool released = false;  // parted too far: the answer is the one without the seal
};

// The forces of unilateral contact and of a lip seal, which are the last factors of the columns.
struct TouchForces {
  std::vector<double> contact;  // one per row, at least 0, Pa mm^2
  std::vector<double> seal;     // one per pair of the seal, Pa mm^2; zero where it is released
  double residual_mm = 0;       // by how much the gaps miss the conditions; infinite: not found
  std::optional<SealState> seal_state = {};
};

// With a the coefficients of the poses, gaps of q = gap_map a + gaps without contact, and forces
// l >= 0 of the LCP g = q + compliance l >= 0, l g = 0 (LcpSolver). Sealed lips are solved twice:
// with free lips for the heights of the upper edge, and with the lower edge held there
// (docs/prepared-answers.md).
//
// Thread-safe. Forces do not depend on what was asked before.
class ContactForces {
 public:
  // `answers` may move, but their sections must outlive it and stay where they are.
  explicit ContactForces(const PortableAnswers& answers);
  ContactForces(ContactForces&&) noexcept;
  ContactForces& operator=(ContactForces&&) noexcept;
  ~ContactForces();

  // Nothing without contact rows.
  TouchForces At(const PortableAnswers& answers, std::span<const double> coefficients) const;

  // Appends the forces to `factors`, which are a. Returns the residual.
  double Append(const PortableAnswers& answers, std::vector<double>* factors) const;

 private:
  struct Solvers;
  struct Spare;  // solvers that are free

  std::unique_ptr<Solvers> Borrow(const PortableAnswers& answers) const;
  void SolveSealed(const PortableAnswers& answers, std::span<const double> coefficients,
                   std::vector<double> gaps, Solvers* solvers, TouchForces* forces) const;

  std::unique_ptr<Spare> spare_;
  // Of a lower edge that is held: how the forces on it change the gaps (#rows by #pairs), and the
  // compliance of the rows.
  std::vector<double> seal_across_;
  std::vector<double> sealed_compliance_;
};

}  // namespace tissueform
