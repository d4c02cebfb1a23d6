// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/contact_forces.h"

#include <atomic>
#include <cstddef>
#include <limits>

#include "core/mechanics/contact/lcp_solver.h"

namespace tissueform {
namespace {

std::vector<double> GapsOf(const PortableAnswers& answers, const std::vector<double>& a) {
  std::vector<double> gaps = answers.contact_gaps;
  const double* column = answers.contact_gap_map.data();
  for (const double coefficient : a) {
    for (double& gap : gaps) gap += *column++ * coefficient;
  }
  return gaps;
}

}  // namespace

// A solver remembers which rows were active, which makes the next pose of a drag cheap. Who finds
// none makes another one: two threads seldom ask at once.
struct ContactForces::Spare {
  std::atomic<LcpSolver*> solver{nullptr};

  ~Spare() { delete solver.load(); }
};

ContactForces::ContactForces(const PortableAnswers& answers)
    : spare_(answers.contact_gaps.empty() ? nullptr : std::make_unique<Spare>()) {}

ContactForces::ContactForces(ContactForces&&) noexcept = default;
ContactForces& ContactForces::operator=(ContactForces&&) noexcept = default;
ContactForces::~ContactForces() = default;

double ContactForces::Append(const PortableAnswers& answers, std::vector<double>* factors) const {
  if (spare_ == nullptr) return 0;
  std::unique_ptr<LcpSolver> solver(spare_->solver.exchange(nullptr));
  if (solver == nullptr) {
    solver = std::make_unique<LcpSolver>(answers.contact_compliance, answers.contact_gaps.size());
  }
  const LcpSolution& solution = solver->Solve(GapsOf(answers, *factors));
  factors->insert(factors->end(), solution.multipliers.begin(), solution.multipliers.end());
  const double residual_mm =
      solution.converged ? solution.kkt_residual_mm : std::numeric_limits<double>::infinity();
  const std::unique_ptr<LcpSolver> another(spare_->solver.exchange(solver.release()));
  return residual_mm;
}

}  // namespace tissueform
