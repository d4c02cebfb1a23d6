// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/contact_forces.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/contact/lcp_solver.h"

namespace tissueform {
namespace {

// Matrices are column-major. result += M x.
void AddProduct(const std::vector<double>& matrix, std::span<const double> x,
                std::vector<double>* result) {
  const double* entry = matrix.data();
  for (const double factor : x) {
    for (double& sum : *result) sum += *entry++ * factor;
  }
}

// result -= M^T x, M being of x.size() rows.
void SubtractTransposedProduct(const std::vector<double>& matrix, std::span<const double> x,
                               std::vector<double>* result) {
  const double* entry = matrix.data();
  for (double& sum : *result) {
    for (const double factor : x) sum -= *entry++ * factor;
  }
}

// A^T B, of two matrices with so many rows: as wide as B.
std::vector<double> TransposedProduct(const std::vector<double>& a, const std::vector<double>& b,
                                      size_t rows) {
  std::vector<double> product;
  product.reserve(a.size() / rows * (b.size() / rows));
  for (size_t j = 0; j < b.size(); j += rows) {
    for (size_t i = 0; i < a.size(); i += rows) {
      double sum = 0;
      for (size_t k = 0; k < rows; ++k) sum += a[i + k] * b[j + k];
      product.push_back(sum);
    }
  }
  return product;
}

// C - across Cus^T, with Cus^T the gaps of the seal's forces: the mean of both triangles, as two
// products differ in their last digits.
std::vector<double> SealedCompliance(const PortableAnswers& answers,
                                     const std::vector<double>& across) {
  const size_t rows = answers.contact_gaps.size();
  const size_t pairs = across.size() / rows;
  std::vector<double> compliance = answers.contact_compliance;
  for (size_t j = 0; j < rows; ++j) {
    for (size_t i = 0; i < rows; ++i) {
      for (size_t p = 0; p < pairs; ++p) {
        const double* of_forces = answers.seal_lower_forces.data();
        compliance[i + j * rows] -= 0.5 * (across[i + p * rows] * of_forces[p + j * pairs] +
                                           across[j + p * rows] * of_forces[p + i * pairs]);
      }
    }
  }
  return compliance;
}

double ResidualMm(const LcpSolution& solution) {
  return solution.converged ? solution.kkt_residual_mm : std::numeric_limits<double>::infinity();
}

double LargestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

}  // namespace

struct ContactForces::Solvers {
  LcpSolver free;
  LcpSolver sealed;
};

// Solvers remember which rows were active, which makes the next pose of a drag cheap. Who finds
// none makes others: two threads seldom ask at once.
struct ContactForces::Spare {
  std::atomic<Solvers*> solvers{nullptr};

  ~Spare() { delete solvers.load(); }
};

ContactForces::ContactForces(const PortableAnswers& answers)
    : spare_(answers.contact_gaps.empty() ? nullptr : std::make_unique<Spare>()) {
  if (answers.seal_release.empty()) return;
  const size_t pairs = SealPairs(answers);
  seal_across_ = TransposedProduct(answers.seal_lower_forces, answers.seal_stiffness, pairs);
  sealed_compliance_ = SealedCompliance(answers, seal_across_);
}

ContactForces::ContactForces(ContactForces&&) noexcept = default;
ContactForces& ContactForces::operator=(ContactForces&&) noexcept = default;
ContactForces::~ContactForces() = default;

std::unique_ptr<ContactForces::Solvers> ContactForces::Borrow(
    const PortableAnswers& answers) const {
  std::unique_ptr<Solvers> solvers(spare_->solvers.exchange(nullptr));
  if (solvers != nullptr) return solvers;
  const size_t rows = answers.contact_gaps.size();
  return std::unique_ptr<Solvers>(
      new Solvers{.free = LcpSolver(answers.contact_compliance, rows),
                  .sealed = LcpSolver(sealed_compliance_, sealed_compliance_.empty() ? 0 : rows)});
}

TouchForces ContactForces::At(const PortableAnswers& answers,
                              std::span<const double> coefficients) const {
  TouchForces forces;
  if (spare_ == nullptr) return forces;
  std::unique_ptr<Solvers> solvers = Borrow(answers);
  std::vector<double> gaps = answers.contact_gaps;
  AddProduct(answers.contact_gap_map, coefficients, &gaps);
  const LcpSolution& free = solvers->free.Solve(gaps);
  forces.contact = free.multipliers;
  forces.residual_mm = ResidualMm(free);
  if (!answers.seal_release.empty()) {
    SolveSealed(answers, coefficients, std::move(gaps), solvers.get(), &forces);
  }
  const std::unique_ptr<Solvers> others(spare_->solvers.exchange(solvers.release()));
  return forces;
}

// `forces` are those of free lips, `gaps` those without contact.
void ContactForces::SolveSealed(const PortableAnswers& answers,
                                std::span<const double> coefficients, std::vector<double> gaps,
                                Solvers* solvers, TouchForces* forces) const {
  const size_t pairs = SealPairs(answers);
  forces->seal.assign(pairs, 0.0);
  std::vector<double> upper(pairs, 0.0);
  AddProduct(answers.seal_upper_map, coefficients, &upper);
  AddProduct(answers.seal_upper_forces, forces->contact, &upper);
  std::vector<double> lower(pairs, 0.0);
  AddProduct(answers.seal_lower_map, coefficients, &lower);
  std::vector<double> raise = upper;
  for (size_t p = 0; p < pairs; ++p) raise[p] -= lower[p];
  AddProduct(answers.seal_lower_forces, forces->contact, &lower);
  SealState state{.parted_mm = LargestDifference(upper, lower)};
  state.released = !(state.parted_mm <= answers.seal_release[0]);
  forces->seal_state = state;
  if (state.released) return;
  AddProduct(seal_across_, raise, &gaps);
  const LcpSolution& sealed = solvers->sealed.Solve(gaps);
  forces->contact = sealed.multipliers;
  forces->residual_mm += ResidualMm(sealed);
  AddProduct(answers.seal_stiffness, raise, &forces->seal);
  SubtractTransposedProduct(seal_across_, forces->contact, &forces->seal);
}

double ContactForces::Append(const PortableAnswers& answers, std::vector<double>* factors) const {
  if (spare_ == nullptr) return 0;
  const TouchForces forces = At(answers, *factors);
  factors->insert(factors->end(), forces.contact.begin(), forces.contact.end());
  factors->insert(factors->end(), forces.seal.begin(), forces.seal.end());
  return forces.residual_mm;
}

}  // namespace tissueform
