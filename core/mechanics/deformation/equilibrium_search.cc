// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/equilibrium_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Share of the decrease that the slope promises which a step must bring (Armijo).
constexpr double kSufficientDecrease = 1e-4;
// Energies closer than this to each other, relative to their size, differ by rounding; the slope
// then shows whether a step is good (Hager and Zhang 2005).
constexpr double kEnergyRounding = 1e-13;
constexpr double kSlopeDecrease = 0.9;
constexpr int kMaxTrials = 40;
// Bounds of what an interpolated length may be of the one before.
constexpr double kSmallestShortening = 0.1;
constexpr double kLargestShortening = 0.5;

}  // namespace

EquilibriumSearch::EquilibriumSearch(NeoHookeanEnergy* energy, const DirichletSystem* system,
                                     const SinglePrecisionSolver* rounded,
                                     const TurningContact* contact, double force_unit, int history)
    : energy_(*energy),
      system_(*system),
      rounded_(rounded),
      contact_(contact),
      force_unit_(force_unit),
      history_(history) {}

bool EquilibriumSearch::Start(Positions displacements) {
  trial_.displacements = std::move(displacements);
  trial_.value = energy_.Evaluate(trial_.displacements, &trial_.gradient);
  if (trial_.value.inverted_tets > 0) {
    return false;
  }
  history_.Clear();
  Accept(&trial_);
  return true;
}

void EquilibriumSearch::PreconditionBy(const DirichletSystem* system) {
  history_.Clear();
  tangent_ = system;
}

void EquilibriumSearch::Accept(Trial* trial) {
  std::swap(displacements_, trial->displacements);
  std::swap(gradient_, trial->gradient);
  value_ = trial->value;
  if (contact_ == nullptr) {
    free_gradient_ = FreePart(gradient_);
  } else {
    Eigen::VectorXd local = LocalGradient();
    contact_->Project(&local);
    free_gradient_ = local(system_.free());
  }
  const double free2 = free_gradient_.squaredNorm();
  const double reaction = std::sqrt(std::max(0.0, gradient_.squaredNorm() - free2));
  // Against the reactions, so that the tolerance means the same for soft and stiff, large and
  // small. The force unit keeps it a number at rest, where the reactions are 0.
  residual_ = std::sqrt(free2) / (reaction + force_unit_);
}

absl::StatusOr<double> EquilibriumSearch::Step() {
  if (system_.num_free() == 0) {
    return 0.0;
  }
  const auto precondition = [this](const Eigen::VectorXd& rhs) { return Precondition(rhs); };
  TF_ASSIGN_OR_RETURN(Eigen::VectorXd direction, history_.Apply(free_gradient_, precondition));
  direction = -direction;
  const double slope = free_gradient_.dot(direction);
  const double length =
      SearchLine(contact_ == nullptr ? direction : FreeAlongAxes(direction), slope);
  // No length lowers the energy along the L-BFGS direction: the remembered pairs may be of another
  // valley. Without them the direction is that of the linear stiffness alone, a sure one of
  // descent; if that fails too, this is the end of what the arithmetic can do.
  if (length == 0) {
    if (history_.empty()) {
      return 0.0;
    }
    history_.Clear();
    return Step();
  }
  step_length_ = length;
  const Eigen::VectorXd before = free_gradient_;
  Accept(&trial_);
  direction *= length;
  const Eigen::Map<const Positions> moved(direction.data(), direction.size() / 3, 3);
  const double change = std::sqrt(moved.rowwise().squaredNorm().maxCoeff());
  history_.Add(std::move(direction), free_gradient_ - before);
  return change;
}

double EquilibriumSearch::SearchLine(const Eigen::VectorXd& direction, double slope) {
  const double rounding = kEnergyRounding * std::abs(value_.energy_nj);
  double length = slope < 0 ? 1.0 : 0.0;
  for (int trial = 0; trial < kMaxTrials && length > 0; ++trial) {
    trial_.displacements = displacements_;
    Eigen::Map<Eigen::VectorXd>(trial_.displacements.data(),
                                trial_.displacements.size())(system_.free()) += length * direction;
    trial_.value = energy_.Evaluate(trial_.displacements, &trial_.gradient);
    // Behind an inverted tet the energy is infinite, so there is no parabola to lay through it.
    if (trial_.value.inverted_tets > 0) {
      length *= kLargestShortening;
      continue;
    }
    const double rise = trial_.value.energy_nj - value_.energy_nj;
    if (rise <= kSufficientDecrease * length * slope) {
      return length;
    }
    // Near the end the decrease that Armijo asks for is smaller than the rounding of the energies,
    // and a good step would be refused; the slope has kept its digits.
    if (rise <= rounding &&
        std::abs(FreePart(trial_.gradient).dot(direction)) <= kSlopeDecrease * -slope) {
      return length;
    }
    // The minimum of the parabola through both energies and the slope.
    const double minimum = -0.5 * slope * length * length / (rise - slope * length);
    length = std::clamp(minimum, kSmallestShortening * length, kLargestShortening * length);
  }
  return 0;
}

Eigen::VectorXd EquilibriumSearch::FreePart(const Positions& field) const {
  return Eigen::Map<const Eigen::VectorXd>(field.data(), field.size())(system_.free());
}

Eigen::VectorXd EquilibriumSearch::WithOthers(const Eigen::VectorXd& free) const {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(system_.num_unknowns());
  all(system_.free()) = free;
  return all;
}

Eigen::VectorXd EquilibriumSearch::FreeAlongAxes(const Eigen::VectorXd& local) const {
  Eigen::VectorXd all = WithOthers(local);
  contact_->FromLocal(&all);
  return all(system_.free());
}

Eigen::VectorXd EquilibriumSearch::LocalGradient() const {
  Eigen::VectorXd local = Eigen::Map<const Eigen::VectorXd>(gradient_.data(), gradient_.size());
  contact_->ToLocal(&local);
  return local;
}

absl::StatusOr<Eigen::VectorXd> EquilibriumSearch::Precondition(const Eigen::VectorXd& rhs) {
  if (contact_ == nullptr) return Solve(rhs);
  TF_ASSIGN_OR_RETURN(
      const Eigen::VectorXd response,
      contact_->Respond(WithOthers(rhs),
                        [this](const Eigen::VectorXd& forces) -> absl::StatusOr<Eigen::VectorXd> {
                          TF_ASSIGN_OR_RETURN(const Eigen::VectorXd solution,
                                              Solve(forces(system_.free())));
                          return WithOthers(solution);
                        }));
  return Eigen::VectorXd(response(system_.free()));
}

absl::StatusOr<Eigen::VectorXd> EquilibriumSearch::Solve(const Eigen::VectorXd& rhs) {
  if (tangent_ == nullptr && rounded_ != nullptr) {
    // Forces of any size fit into single precision as shares of the largest.
    const double unit = rhs.lpNorm<Eigen::Infinity>();
    if (unit == 0) {
      return rhs;
    }
    rounded_rhs_ = (rhs / unit).cast<float>();
    rounded_->Solve(rounded_rhs_, &rounded_solution_);
    return Eigen::VectorXd(unit * rounded_solution_.cast<double>());
  }
  rhs_ = rhs;
  const DirichletSystem& system = tangent_ != nullptr ? *tangent_ : system_;
  TF_RETURN_IF_ERROR(system.SolveFree(rhs_, &solution_));
  return Eigen::VectorXd(solution_.col(0));
}

int64_t EquilibriumSearch::BytesNeeded(Eigen::Index num_vertices, int history) {
  // State and trial, the linear system's two sides, a step's direction and gradient; the pairs.
  const Eigen::Index fields = 8 + 2 * Eigen::Index{history};
  return fields * 3 * num_vertices * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
