// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/plan_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/plan_fitting/bounded_least_squares.h"
#include "core/mechanics/plan_fitting/fit_contradictions.h"
#include "core/mechanics/plan_fitting/fit_rows.h"
#include "core/mechanics/plan_fitting/fit_unknowns.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Numbers of the targets that change by less when the full model is asked again end the search.
constexpr double kModelSettledMm = 2e-4;
constexpr int kMaxModelAnswers = 8;
class Fitting {
 public:
  Fitting(const FitProblem& problem, const TetMesh& mesh, const ConstraintSet& constraints,
          const VertexResponse& response, const FitOptions& options)
      : problem_(problem),
        response_(response),
        options_(options),
        rows_(problem),
        unknowns_(problem, mesh, constraints) {}

  absl::StatusOr<PlanFit> Run() {
    PlanFit fit;
    VectorXd correction =
        VectorXd::Zero(rows_.wanted_mm().size());  // full model - prepared answers
    const Stopwatch stopwatch;
    LeastSquaresSolution solution = Search(unknowns_.Start(), correction, &fit);
    fit.search_seconds = stopwatch.Seconds();
    VectorXd reached = Prepared(solution.x) + correction;
    Positions positions;
    while (options_.full_model != nullptr) {
      TF_RETURN_IF_ERROR(options_.cancellation.Check());
      TF_ASSIGN_OR_RETURN(positions, AskFullModel(solution.x, &fit));
      reached = rows_.At(positions);
      const VectorXd measured = reached - Prepared(solution.x);
      const double change = (measured - correction).cwiseAbs().maxCoeff();
      correction = measured;
      fit.prepared_error_mm = correction.cwiseAbs().maxCoeff();
      if (change <= kModelSettledMm || fit.model_answers >= kMaxModelAnswers) break;
      const Stopwatch again;
      solution = Search(solution.x, correction, &fit);
      fit.search_seconds += again.Seconds();
    }
    if (options_.full_model == nullptr) positions = PreparedPositions(solution.x);
    Describe(solution, reached, positions, &fit);
    return fit;
  }

 private:
  Positions PreparedPositions(const VectorXd& x) const {
    FloatPositions positions;
    response_.Evaluate(unknowns_.PosesOf(x), &positions);
    return positions.cast<double>();
  }

  VectorXd Prepared(const VectorXd& x) const { return rows_.At(PreparedPositions(x)); }

  // At the chosen vertices.
  absl::StatusOr<Positions> AskFullModel(const VectorXd& x, PlanFit* fit) const {
    DeformControl control;
    control.warm_start = fit->model_answers > 0;
    control.on_progress = [this](const Deformation& /*so_far*/) {
      return !options_.cancellation.requested();
    };
    TF_ASSIGN_OR_RETURN(const Deformation answer,
                        options_.full_model->Deform(unknowns_.PosesOf(x), control));
    TF_RETURN_IF_ERROR(options_.cancellation.Check());
    ++fit->model_answers;
    fit->verified = true;
    fit->seal = answer.seal;
    fit->model_converged = answer.summary.converged && answer.summary.load >= 1;
    return Positions(answer.positions(rows_.vertices(), Eigen::all));
  }

  LeastSquaresSolution Search(const VectorXd& start, const VectorXd& correction,
                              PlanFit* fit) const {
    LeastSquaresProblem problem;
    problem.residuals = [&](const VectorXd& x) -> VectorXd {
      return rows_.root_weights().cwiseProduct(Prepared(x) + correction - rows_.wanted_mm());
    };
    unknowns_.Describe(&problem);
    problem.smallest_move = 1e-5;  // mm of bone, as good as single precision
    LeastSquaresSolution solution = SolveBoundedLeastSquares(problem, start);
    fit->iterations += solution.iterations;
    fit->converged = solution.converged;
    return solution;
  }

  void Describe(const LeastSquaresSolution& solution, const VectorXd& reached,
                const Positions& positions, PlanFit* fit) const {
    fit->poses = unknowns_.PosesOf(solution.x);
    const VectorXd& scales = unknowns_.scales();
    const MatrixXd jacobian = solution.jacobian * scales.asDiagonal();  // by rad and mm
    FitQuality quality =
        MeasureFitQuality(jacobian, unknowns_.movement(), solution.bounds, problem_.less_movement);
    for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
      const double value = solution.x[static_cast<Index>(i)] / scales[static_cast<Index>(i)];
      fit->unknowns.push_back({value, solution.bounds[i], quality.unknowns[i]});
    }
    fit->directions = std::move(quality.directions);
    fit->contradictions =
        FindContradictions(problem_, solution.jacobian, reached - rows_.wanted_mm());
    fit->movement_mm = unknowns_.MovementMm(solution.x);
    Index row = 0;
    for (size_t t = 0; t < problem_.targets.size(); ++t) {
      const Index count = problem_.targets[t].along.rows();
      const VectorXd part = reached.segment(row, count);
      fit->targets.push_back(
          {part, (part - problem_.targets[t].wanted_mm).norm(), rows_.PointAt(t, positions)});
      row += count;
    }
  }

  const FitProblem& problem_;
  const VertexResponse& response_;
  const FitOptions& options_;
  const FitRows rows_;
  const FitUnknowns unknowns_;
};

}  // namespace

std::vector<int32_t> FitVertices(const FitProblem& problem) { return FitRows(problem).vertices(); }

double LargestFitRotation(const FitProblem& problem) {
  double largest = 0;
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    Vector3d rotation = problem.poses[h].rotation_vector.cwiseAbs();
    for (const FitUnknown& unknown : problem.unknowns) {
      if (unknown.handle != h || !unknown.is_rotation) continue;
      rotation[unknown.axis] = std::max(std::abs(unknown.lower), std::abs(unknown.upper));
    }
    largest = std::max(largest, rotation.norm());
  }
  return largest + kFitRotationStep;
}

absl::StatusOr<PlanFit> FitPlan(const FitProblem& problem, const TetMesh& mesh,
                                const ConstraintSet& constraints, const VertexResponse& response,
                                const FitOptions& options) {
  return Fitting(problem, mesh, constraints, response, options).Run();
}

}  // namespace tissueform
