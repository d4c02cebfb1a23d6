// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/neo_hookean_deformer.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/contact/lcp_solver.h"
#include "core/mechanics/deformation/contact_blocker.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/equilibrium_search.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/load_path.h"
#include "core/mechanics/deformation/newton_fallback.h"
#include "core/mechanics/deformation/turning_contact.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"

namespace tissueform {
namespace {

// The furthest that a handle turns in one load step. Linear elasticity, whose answer a search
// begins with, takes a turn for a strain of cos(angle) - 1: 13 % at 30 degrees.
constexpr double kLargestTurn = std::numbers::pi / 6;
// Load steps shorter than this are not tried: nine halvings of the whole way. What does not go
// through then is reported with the load that was reached, and is no error.
constexpr double kSmallestLoadStep = 1.0 / 512;
// Tissue squeezed to less than this part of its volume stands in the way of a search. Only for the
// message. Searches that ran out of iterations were seen to end at 0.08 to 0.1, by the processor.
constexpr double kCrushed = 0.2;
// Residual at which a load step is left for the next one: only the last equilibrium is an answer,
// the ones before need to be near enough to begin the next step from.
constexpr double kStepTolerance = 0.02;
// Strain whose forces are added to those that the residual is measured by.
constexpr double kSmallStrain = 1e-6;
// Of a row of contact, in mm: what it may penetrate, or the gap that the force would close with
// which it may pull. An equilibrium is not found more exactly.
constexpr double kLargestPenetration = 1e-3;
// The gap in mm of a row that is met: rounding.
constexpr double kLargestMiss = 1e-7;
// Exchanges of all violating rows that may pass without reducing their number; all exchanges at one
// load.
constexpr int kBlockPatience = 5;
constexpr int kMaxExchanges = 200;
// Of the way to where exchanged rows are met.
constexpr double kSmallestCorrection = 1.0 / 16;
// Up to this condition number the factor rounded to single precision preconditions as well as the
// factor itself, in half the time.
constexpr double kLargestRoundedCondition = 1e6;

absl::Status CheckOptions(const NeoHookeanOptions& options) {
  if (options.max_iterations < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_iterations is ", options.max_iterations, "; it must be at least 1"));
  }
  if (!std::isfinite(options.tolerance) || options.tolerance <= 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance is ", options.tolerance, "; it must be a positive number"));
  }
  if (options.history < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("history is ", options.history, "; it must not be negative"));
  }
  if (options.newton_after < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("newton_after is ", options.newton_after, "; it must not be negative"));
  }
  return absl::OkStatus();
}

// Forces, in Pa mm^2, of a strain of kSmallStrain in every tet: E |t|^(2/3) each.
double ForceUnit(const MeshPreparation& preparation) {
  return kSmallStrain *
         (preparation.stiffness().array() * preparation.elements().measures.array().pow(2.0 / 3.0))
             .matrix()
             .norm();
}

// How far every vertex goes along with each handle, #V by #handles: the mean of what the linear
// model answers to unit translations, within [0, 1]. One on the handle, zero on the other
// constrained ones.
Eigen::MatrixXd HandleShares(const ElasticSystem& elastic, Eigen::Index num_vertices) {
  const Eigen::MatrixXd& columns = elastic.response_columns();
  Eigen::MatrixXd shares(num_vertices, columns.cols() / ElasticSystem::kColumnsPerHandle);
  for (Eigen::Index h = 0; h < shares.cols(); ++h) {
    for (Eigen::Index v = 0; v < num_vertices; ++v) {
      double sum = 0;
      for (int axis = 0; axis < 3; ++axis) {
        sum += columns(3 * v + axis, ElasticSystem::kColumnsPerHandle * h + 4 * axis + 3);
      }
      shares(v, h) = std::clamp(sum / 3.0, 0.0, 1.0);
    }
  }
  return shares;
}

bool UsesRoundedFactor(const ElasticSystem& elastic) {
  return elastic.system().num_free() > 0 &&
         elastic.condition_estimate() <= kLargestRoundedCondition;
}

// The closed rows of contact before an exchange, and how many more exchanges are allowed.
struct ExchangeRun {
  size_t fewest_violations = std::numeric_limits<size_t>::max();
  int patience = kBlockPatience;
  int left = kMaxExchanges;

  // Whether so many rows may be exchanged at once. If that stops reducing their number, one at a
  // time always ends (LcpSolver).
  bool MayExchangeAll(size_t violations) {
    if (violations < fewest_violations) {
      fewest_violations = violations;
      patience = kBlockPatience;
      return true;
    }
    return patience-- > 0;
  }
};

// Of the unilateral rows.
struct ContactState {
  Eigen::VectorXd forces;
  Eigen::VectorXd gaps;
};

// What a deformer holds beside the preparation.
int64_t BytesNeeded(const MeshPreparation& preparation, const NeoHookeanOptions& options) {
  const Eigen::Index num_vertices = preparation.mesh().num_vertices();
  const auto handles = static_cast<int64_t>(preparation.constraints().handles().size());
  return TurningContact::BytesNeeded(preparation.constraints()) +
         NeoHookeanEnergy::BytesNeeded(preparation.mesh().num_tets()) +
         EquilibriumSearch::BytesNeeded(num_vertices, options.history) +
         num_vertices * handles * static_cast<int64_t>(sizeof(double));
}

class NeoHookeanDeformer : public Deformer {
 public:
  // `rounded` and both of contact may be null.
  NeoHookeanDeformer(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                     const SinglePrecisionSolver* rounded, const ElasticContact* linear_contact,
                     std::unique_ptr<TurningContact> contact, const NeoHookeanOptions& options)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        linear_contact_(linear_contact),
        options_(options),
        shares_(HandleShares(elastic, rest().rows())),
        energy_(preparation_->elements(), preparation_->vertex_cells(), preparation_->stiffness(),
                preparation_->options().poisson_ratio, preparation_->options().threads),
        contact_(std::move(contact)),
        search_(&energy_, &elastic.system(), rounded, contact_.get(), ForceUnit(*preparation_),
                options.history),
        newton_(preparation_.get(), &elastic, &search_, options.newton_after,
                options.newton_blas_threads) {
    const FactorizationSummary& factorization = elastic_.system().factorization();
    summary_.assemble_seconds = elastic_.assemble_seconds();
    summary_.analyse_seconds = factorization.analyse_seconds;
    summary_.factorise_seconds = factorization.factorise_seconds;
    summary_.prepare_seconds = elastic_.response_seconds();
    summary_.factor_bytes = factorization.factor_bytes;
    summary_.own_bytes = BytesNeeded(*preparation_, options_);
    summary_.bytes_held = preparation_->bytes_held() + summary_.own_bytes;
  }

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& control) override {
    TF_RETURN_IF_ERROR(CheckPoses(preparation_->constraints(), poses));
    newton_.Begin(control.admission);
    const absl::Cleanup end_of_newton = [this] { newton_.End(); };
    if (control.warm_start && !last_poses_.empty()) {
      TF_ASSIGN_OR_RETURN(Deformation deformation,
                          Walk(LoadPath(last_poses_, poses), Begin::kWhereItIs, control));
      // From the last answer a far pose may not be reached, where from rest it is: begin again.
      if (deformation.summary.load == 1.0 || deformation.summary.cancelled) {
        return deformation;
      }
    }
    return Walk(LoadPath(poses), Begin::kAtRest, control);
  }

  const PreparationSummary& preparation() const override { return summary_; }

 private:
  enum class Begin { kAtRest, kWhereItIs };

  // What one answer needs beside the state of the search.
  struct Run {
    const LoadPath& path;
    const DeformControl& control;
    Stopwatch stopwatch;
    Deformation deformation;
    double step = 1;  // of the load, next

    SolveSummary& summary() { return deformation.summary; }
  };

  const Positions& rest() const { return preparation_->mesh().positions(); }

  // Follows the path as far as it goes and remembers the end for the next warm start.
  absl::StatusOr<Deformation> Walk(const LoadPath& path, Begin begin,
                                   const DeformControl& control) {
    Run run{path, control, {}, {}, {}};
    run.summary().iterations = 0;
    run.summary().load = 0;
    run.summary().converged = false;
    last_poses_.clear();
    // Only turns are cut into steps. A translation, however long, is tried at once from the linear
    // answer; where that inverts tets the way is walked from rest, in steps that are halved.
    run.step = std::min(1.0, kLargestTurn / std::max(path.LargestTurn(), kLargestTurn));
    if (begin == Begin::kAtRest) {
      TF_ASSIGN_OR_RETURN(const bool starts_at_end,
                          run.step == 1.0 ? StartFromLinear(&run) : absl::StatusOr<bool>(false));
      if (!starts_at_end) {
        if (contact_ != nullptr) contact_->SetPoses(path.PosesAt(0));
        search_.Start(Positions::Zero(rest().rows(), 3));
      }
    }
    if (run.summary().load == 1.0) {
      TF_RETURN_IF_ERROR(Relax(&run));
    }
    while (run.summary().load < 1.0 && !IsBlocked(run) && MayGoOn(&run)) {
      TF_ASSIGN_OR_RETURN(const bool advanced, Advance(&run));
      if (!advanced) {
        run.step *= 0.5;
        continue;
      }
      TF_RETURN_IF_ERROR(Relax(&run));
    }
    Finish(&run);
    return std::move(run.deformation);
  }

  // False when the linear answer to the whole load inverts tets.
  absl::StatusOr<bool> StartFromLinear(Run* run) {
    const std::vector<HandlePose> poses = run->path.PosesAt(1.0);
    const Eigen::VectorXd coefficients = elastic_.Coefficients(poses);
    Eigen::VectorXd linear = elastic_.response_columns() * coefficients;
    std::vector<int32_t> closed;
    if (contact_ != nullptr && !linear_contact_->rows().empty()) {
      TF_RETURN_IF_ERROR(AddLinearContact(coefficients, &linear, &closed));
    }
    Positions displacements = Eigen::Map<const Positions>(linear.data(), rest().rows(), 3);
    SetConstrained(poses, &displacements);
    TF_ASSIGN_OR_RETURN(const bool starts,
                        StartAt(poses, std::move(displacements), std::move(closed)));
    if (starts) run->summary().load = 1.0;
    return starts;
  }

  // To the linear answer; `closed` are the rows that touch in it.
  absl::Status AddLinearContact(const Eigen::VectorXd& coefficients, Eigen::VectorXd* linear,
                                std::vector<int32_t>* closed) const {
    const Eigen::MatrixXd& C = linear_contact_->compliance();
    const Eigen::VectorXd gaps = linear_contact_->Gaps(coefficients);
    LcpSolver solver({C.data(), static_cast<size_t>(C.size())}, static_cast<size_t>(C.rows()));
    const LcpSolution& solution = solver.Solve({gaps.data(), static_cast<size_t>(gaps.size())});
    TF_ASSIGN_OR_RETURN(const Eigen::VectorXd pushed,
                        linear_contact_->Displacements(solution.multipliers));
    *linear += pushed;
    *closed = solution.active;
    return absl::OkStatus();
  }

  // Starts the search from displacements that meet the rows of contact at the poses; false when
  // that inverts tets.
  absl::StatusOr<bool> StartAt(absl::Span<const HandlePose> poses, Positions displacements,
                               std::vector<int32_t> closed) {
    if (contact_ != nullptr) {
      contact_->SetPoses(poses);
      TF_RETURN_IF_ERROR(contact_->Close(std::move(closed)));
      TF_ASSIGN_OR_RETURN(const Positions correction, contact_->Correction(displacements));
      displacements += correction;
    }
    return search_.Start(std::move(displacements));
  }

  static bool IsBlocked(const Run& run) { return run.step < kSmallestLoadStep; }

  // Where the next load step ends.
  static double EndOfStep(const Run& run) {
    const double remaining = 1.0 - run.deformation.summary.load;
    // No crumb is left for the end.
    return remaining < 1.01 * run.step ? 1.0 : run.deformation.summary.load + run.step;
  }

  std::optional<ContactBlocker> Crossing(const Run& run, double end) const {
    return FindCrossing(*preparation_, run.path.PosesAt(run.deformation.summary.load),
                        run.path.PosesAt(end));
  }

  // The state carried on to another load.
  Positions Carried(const Run& run, double end) const {
    const Positions positions = rest() + search_.displacements();
    Positions displacements =
        run.path.Carry(positions, shares_, run.deformation.summary.load, end) - rest();
    SetConstrained(run.path.PosesAt(end), &displacements);
    return displacements;
  }

  // Carries the state on by a load step; false when that inverts tets. Newton steps go on where
  // L-BFGS got stuck, also to where a handle has passed through a region as a whole: not so far.
  absl::StatusOr<bool> Advance(Run* run) {
    const double end = EndOfStep(*run);
    if (run->summary().newton_steps > 0 && Crossing(*run, end).has_value()) {
      return false;
    }
    const std::vector<int32_t> closed =
        contact_ != nullptr ? contact_->closed() : std::vector<int32_t>();
    TF_ASSIGN_OR_RETURN(const bool starts,
                        StartAt(run->path.PosesAt(end), Carried(*run, end), closed));
    if (starts) {
      run->summary().load = end;
    } else if (contact_ != nullptr) {
      contact_->SetPoses(run->path.PosesAt(run->summary().load));
      TF_RETURN_IF_ERROR(contact_->Close(closed));
    }
    return starts;
  }

  void SetConstrained(const std::vector<HandlePose>& poses, Positions* displacements) const {
    const auto& constrained = preparation_->constraints().constrained();
    (*displacements)(constrained, Eigen::all) =
        ConstrainedPositions(rest(), preparation_->constraints(), poses) -
        rest()(constrained, Eigen::all);
  }

  bool MayGoOn(Run* run) const {
    return !run->summary().cancelled && run->summary().iterations < options_.max_iterations;
  }

  // Towards the equilibrium at the load reached. Rows of contact are exchanged where it is nearly
  // found, as often as it takes, and only then it is looked for to the last.
  absl::Status Relax(Run* run) {
    SolveSummary& summary = run->summary();
    const double tolerance = summary.load == 1.0 ? options_.tolerance : kStepTolerance;
    bool is_settled = contact_ == nullptr;
    if (contact_ != nullptr) {
      ExchangeRun exchanges;
      TF_RETURN_IF_ERROR(
          RelaxWithRows(run, std::max(tolerance, kStepTolerance), &exchanges).status());
      TF_ASSIGN_OR_RETURN(is_settled, RelaxWithRows(run, tolerance, &exchanges));
    } else {
      TF_RETURN_IF_ERROR(RelaxTo(run, tolerance));
    }
    summary.converged =
        is_settled && summary.load == 1.0 && search_.residual() <= options_.tolerance;
    return absl::OkStatus();
  }

  // True when no more row is to be exchanged.
  absl::StatusOr<bool> RelaxWithRows(Run* run, double tolerance, ExchangeRun* exchanges) {
    while (exchanges->left-- > 0) {
      TF_RETURN_IF_ERROR(RelaxTo(run, tolerance));
      if (search_.residual() > tolerance) return false;
      const std::vector<int32_t> violations = Violations();
      const bool meets_rows = contact_->Miss(search_.displacements()) <= kLargestMiss;
      if (violations.empty() && meets_rows) return true;
      if (!MayGoOn(run)) return false;
      TF_ASSIGN_OR_RETURN(const bool exchanged,
                          Exchange(violations, exchanges->MayExchangeAll(violations.size() +
                                                                         (meets_rows ? 0 : 1))));
      if (!exchanged) return false;
    }
    return false;
  }

  ContactState StateOfContact() const {
    return {search_.ContactForces(), contact_->Gaps(search_.displacements())};
  }

  // Rows that penetrate though they are open, or pull though they are closed.
  std::vector<int32_t> Violations() const {
    const ContactState state = StateOfContact();
    const Eigen::MatrixXd& C = linear_contact_->compliance();
    std::vector<int32_t> violations;
    for (Eigen::Index row = 0; row < state.gaps.size(); ++row) {
      const bool is_closed =
          std::ranges::binary_search(contact_->closed(), static_cast<int32_t>(row));
      const double miss_mm = is_closed ? C(row, row) * state.forces[row] : state.gaps[row];
      if (miss_mm < -kLargestPenetration) violations.push_back(static_cast<int32_t>(row));
    }
    return violations;
  }

  // Opens closed rows and closes open ones: all, or the last alone. Where meeting them at once
  // inverts tets a part of the way is gone. False, and nothing is changed, when no part can be.
  absl::StatusOr<bool> Exchange(const std::vector<int32_t>& rows, bool all) {
    const std::vector<int32_t> before = contact_->closed();
    const std::vector<int32_t> chosen(all || rows.empty() ? rows.begin() : rows.end() - 1,
                                      rows.end());
    std::vector<int32_t> closed;
    std::ranges::set_symmetric_difference(before, chosen, std::back_inserter(closed));
    TF_RETURN_IF_ERROR(contact_->Close(std::move(closed)));
    const Positions displacements = search_.displacements();
    TF_ASSIGN_OR_RETURN(const Positions correction, contact_->Correction(displacements));
    double part = 1;
    while (part >= kSmallestCorrection) {
      if (search_.Start(displacements + part * correction)) return true;
      part *= 0.5;
    }
    TF_RETURN_IF_ERROR(contact_->Close(before));
    return false;
  }

  // With the rows of contact that are met now.
  absl::Status RelaxTo(Run* run, double tolerance) {
    SolveSummary& summary = run->summary();
    newton_.Restart();
    bool next_is_newton = false;
    while (search_.residual() > tolerance && MayGoOn(run) && Report(run)) {
      const bool is_newton =
          next_is_newton || (contact_ == nullptr && newton_.Consider(summary.iterations));
      summary.newton_steps += is_newton ? 1 : 0;
      TF_ASSIGN_OR_RETURN(const double change, search_.Step());
      ++summary.iterations;
      summary.changes_mm.push_back(change);
      summary.energies_nj.push_back(search_.value().energy_nj);
      // Where a step gets nowhere, Newton's may; where that does not, the search can do no more,
      // and the residual says below whether that is enough.
      next_is_newton = change == 0 && !is_newton && contact_ == nullptr && newton_.Take();
      if (change == 0 && !next_is_newton) {
        break;
      }
    }
    return absl::OkStatus();
  }

  // False when the caller wants to hear no more.
  bool Report(Run* run) const {
    if (run->control.on_progress) {
      Describe(run);
      run->summary().cancelled = !run->control.on_progress(run->deformation);
    }
    return !run->summary().cancelled;
  }

  // Writes the state of the search into the answer.
  void Describe(Run* run) const {
    const ConstraintSet& constraints = preparation_->constraints();
    run->summary().residual = search_.residual();
    run->summary().solve_seconds = run->stopwatch.Seconds();
    run->deformation.positions = rest() + search_.displacements();
    run->deformation.positions(constraints.constrained(), Eigen::all) =
        ConstrainedPositions(rest(), constraints, run->path.PosesAt(run->summary().load));
    if (contact_ != nullptr) DescribeContact(&run->deformation.contact);
  }

  void DescribeContact(ContactAnswer* answer) const {
    const ContactState state = StateOfContact();
    if (state.gaps.size() == 0) return;
    const Eigen::VectorXd pressed = state.forces.cwiseMax(0.0);
    answer->forces.assign(pressed.begin(), pressed.end());
    answer->gaps_mm.assign(state.gaps.begin(), state.gaps.end());
    answer->residual_mm =
        state.gaps.cwiseMin(linear_contact_->compliance().diagonal().cwiseProduct(state.forces))
            .lpNorm<Eigen::Infinity>();
  }

  void Finish(Run* run) {
    Describe(run);
    SolveSummary& summary = run->summary();
    summary.second_factor_bytes = summary.newton_steps > 0 ? newton_.bytes_needed() : 0;
    if (!summary.converged && !summary.cancelled) {
      ExplainGivingUp(run);
    }
    if (run->summary().load == 1.0) {
      last_poses_ = run->path.PosesAt(1.0);
    }
  }

  void ExplainGivingUp(Run* run) const {
    SolveSummary& summary = run->summary();
    if (summary.load < 1.0 && IsBlocked(*run)) {
      summary.gave_up = Termination::kBlocked;
    } else if (newton_.had_no_room()) {
      summary.gave_up = Termination::kNoRoom;
    } else if (summary.iterations >= options_.max_iterations) {
      summary.gave_up = Termination::kIterations;
    } else {
      summary.gave_up = Termination::kArithmetic;
    }
    if (summary.gave_up == Termination::kBlocked) {
      // The smallest step that was tried shows what is in the way.
      const double end = std::min(1.0, summary.load + 2 * run->step);
      const std::optional<ContactBlocker> crossing = Crossing(*run, end);
      summary.obstacle =
          Say(crossing.has_value() ? *crossing
                                   : FindObstacle(*preparation_, rest() + Carried(*run, end)));
      return;
    }
    const ContactBlocker worst = FindObstacle(*preparation_, run->deformation.positions);
    if (worst.volume_ratio < kCrushed) {
      summary.obstacle = Say(worst);
    }
  }

  std::string Say(const ContactBlocker& obstacle) const {
    return tissueform::Describe(obstacle, preparation_->constraints());
  }

  // Constant after the constructor.
  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const ElasticContact* const linear_contact_;  // null without contact
  const NeoHookeanOptions options_;
  const Eigen::MatrixXd shares_;  // #V by #handles
  PreparationSummary summary_;

  // The state of the last answer; its poses when it had reached them, else none.
  NeoHookeanEnergy energy_;
  const std::unique_ptr<TurningContact> contact_;  // null without contact
  EquilibriumSearch search_;
  NewtonFallback newton_;
  std::vector<HandlePose> last_poses_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateNeoHookeanDeformer(
    std::shared_ptr<MeshPreparation> preparation, const NeoHookeanOptions& options,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_ASSIGN_OR_RETURN(ElasticSystem * elastic, preparation->Elastic(cancellation));
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (const FactorAdmission& admission = preparation->options().admission) {
    TF_RETURN_IF_ERROR(admission(BytesNeeded(*preparation, options)));
  }
  const SinglePrecisionSolver* rounded = nullptr;
  if (UsesRoundedFactor(*elastic)) {
    TF_ASSIGN_OR_RETURN(rounded, elastic->Rounded(preparation->options().admission));
  }
  const ElasticContact* linear_contact = nullptr;
  std::unique_ptr<TurningContact> contact;
  if (!preparation->constraints().contact().empty()) {
    TF_ASSIGN_OR_RETURN(linear_contact, preparation->Contact(cancellation));
    TF_ASSIGN_OR_RETURN(contact, TurningContact::Create(*preparation, *elastic, *linear_contact));
  }
  return std::make_unique<NeoHookeanDeformer>(std::move(preparation), *elastic, rounded,
                                              linear_contact, std::move(contact), options);
}

}  // namespace tissueform
