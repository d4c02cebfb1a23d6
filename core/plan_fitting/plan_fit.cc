// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_fitting/plan_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/plan_fitting/bounded_least_squares.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Answers are in single precision, 1e-5 mm on a head: a mm of movement tells slopes to that, and
// what three orders of half a degree put them off by is as little.
constexpr double kTranslationStepMm = 0.5;
constexpr double kRotationStep = 0.5 * std::numbers::pi / 180;
// Numbers of the targets that change by less when the full model is asked again end the search.
constexpr double kModelSettledMm = 2e-4;
constexpr int kMostModelAnswers = 8;
// Handles without extent are taken for one of this radius, so that every unknown has a scale.
constexpr double kLeastRadiusMm = 0.1;

class Fitting {
 public:
  Fitting(const FitProblem& problem, const TetMesh& mesh, const ConstraintSet& constraints,
          const VertexResponse& response, const FitOptions& options)
      : problem_(problem),
        mesh_(mesh),
        constraints_(constraints),
        response_(response),
        options_(options),
        vertices_(FitVertices(problem)) {
    PrepareTargets();
    PrepareMovement();
  }

  absl::StatusOr<PlanFit> Run() {
    PlanFit fit;
    VectorXd correction = VectorXd::Zero(wanted_.size());  // full model - prepared answers
    VectorXd x = Start();
    const Stopwatch stopwatch;
    LeastSquaresSolution solution = Search(x, correction, &fit);
    fit.search_seconds = stopwatch.Seconds();
    VectorXd reached = Prepared(solution.x) + correction;
    Positions positions;
    while (options_.full_model != nullptr) {
      TF_RETURN_IF_ERROR(options_.cancellation.Check());
      TF_ASSIGN_OR_RETURN(positions, AskFullModel(solution.x, &fit));
      reached = RowsOf(positions);
      const VectorXd measured = reached - Prepared(solution.x);
      const double change = (measured - correction).cwiseAbs().maxCoeff();
      correction = measured;
      fit.prepared_error_mm = correction.cwiseAbs().maxCoeff();
      if (change <= kModelSettledMm || fit.model_answers >= kMostModelAnswers) break;
      const Stopwatch again;
      solution = Search(solution.x, correction, &fit);
      fit.search_seconds += again.Seconds();
    }
    if (options_.full_model == nullptr) positions = PreparedPositions(solution.x);
    Tell(solution, reached, positions, &fit);
    return fit;
  }

 private:
  void PrepareTargets() {
    const Index rows = problem_.num_equations();
    wanted_.resize(rows);
    root_weights_.resize(rows);
    Index row = 0;
    for (const FitTarget& target : problem_.targets) {
      const Index count = target.along.rows();
      wanted_.segment(row, count) = target.wanted_mm;
      root_weights_.segment(row, count).setConstant(std::sqrt(target.weight));
      row += count;
    }
    for (FitTarget target : problem_.targets) {
      for (int32_t& v : target.point.vertices) {
        v = static_cast<int32_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) -
                                 vertices_.begin());
      }
      chosen_points_.push_back(std::move(target.point));
    }
  }

  // movement_ * x + movement_rest_ is the movement of the bone; unknowns are scaled so that one of
  // each alone is 1 mm of it.
  void PrepareMovement() {
    const auto handles = static_cast<Index>(problem_.poses.size());
    const auto n = static_cast<Index>(problem_.unknowns.size());
    movement_.setZero(6 * handles, n);
    movement_rest_.setZero(6 * handles);
    scales_.setOnes(n);
    for (Index i = 0; i < n; ++i) {
      const FitUnknown& unknown = problem_.unknowns[static_cast<size_t>(i)];
      const size_t h = unknown.handle;
      const Eigen::Matrix<double, 6, 6> root =
          MovementRoot(mesh_, constraints_.handles()[h].vertices, problem_.poses[h].pivot_mm);
      const int component = unknown.axis + (unknown.is_rotation ? 0 : 3);
      movement_.block<6, 1>(6 * static_cast<Index>(h), i) = unknown.sign * root.col(component);
      // What does not move of a handle that does.
      HandlePose rest = problem_.poses[h];
      for (const FitUnknown& other : problem_.unknowns) {
        if (other.handle == h) ComponentOf(other, &rest) = 0;
      }
      Eigen::Matrix<double, 6, 1> numbers;
      numbers << rest.rotation_vector, rest.translation_mm;
      movement_rest_.segment<6>(6 * static_cast<Index>(h)) = root * numbers;
      scales_[i] = std::max(movement_.col(i).norm(), unknown.is_rotation ? kLeastRadiusMm : 1.0);
    }
  }

  static double& ComponentOf(const FitUnknown& unknown, HandlePose* pose) {
    return (unknown.is_rotation ? pose->rotation_vector : pose->translation_mm)[unknown.axis];
  }

  std::vector<HandlePose> PosesOf(const VectorXd& x) const {
    std::vector<HandlePose> poses = problem_.poses;
    for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
      const FitUnknown& unknown = problem_.unknowns[i];
      ComponentOf(unknown, &poses[unknown.handle]) =
          unknown.sign * x[static_cast<Index>(i)] / scales_[static_cast<Index>(i)];
    }
    return poses;
  }

  VectorXd Start() const {
    VectorXd x(static_cast<Index>(problem_.unknowns.size()));
    for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
      const FitUnknown& unknown = problem_.unknowns[i];
      HandlePose pose = problem_.poses[unknown.handle];
      x[static_cast<Index>(i)] =
          unknown.sign * ComponentOf(unknown, &pose) * scales_[static_cast<Index>(i)];
    }
    return x;
  }

  VectorXd Rows(const std::vector<MeshPoint>& points, const Positions& positions) const {
    VectorXd rows(wanted_.size());
    Index row = 0;
    for (size_t t = 0; t < points.size(); ++t) {
      const FitTarget& target = problem_.targets[t];
      const Index count = target.along.rows();
      rows.segment(row, count) = target.along * (PositionOf(points[t], positions) - target.rest_mm);
      row += count;
    }
    return rows;
  }

  Positions PreparedPositions(const VectorXd& x) const {
    FloatPositions positions;
    response_.Evaluate(PosesOf(x), &positions);
    return positions.cast<double>();
  }

  VectorXd Prepared(const VectorXd& x) const { return Rows(chosen_points_, PreparedPositions(x)); }

  VectorXd RowsOf(const Positions& chosen) const { return Rows(chosen_points_, chosen); }

  // At the chosen vertices.
  absl::StatusOr<Positions> AskFullModel(const VectorXd& x, PlanFit* fit) const {
    DeformControl control;
    control.warm_start = fit->model_answers > 0;
    control.on_progress = [this](const Deformation& /*so_far*/) {
      return !options_.cancellation.requested();
    };
    TF_ASSIGN_OR_RETURN(const Deformation answer, options_.full_model->Deform(PosesOf(x), control));
    TF_RETURN_IF_ERROR(options_.cancellation.Check());
    ++fit->model_answers;
    fit->verified = true;
    fit->model_converged = answer.summary.converged && answer.summary.load >= 1;
    return Positions(answer.positions(vertices_, Eigen::all));
  }

  LeastSquaresSolution Search(const VectorXd& start, const VectorXd& correction,
                              PlanFit* fit) const {
    LeastSquaresProblem problem;
    problem.residuals = [&](const VectorXd& x) -> VectorXd {
      return root_weights_.cwiseProduct(Prepared(x) + correction - wanted_);
    };
    const auto n = static_cast<Index>(problem_.unknowns.size());
    problem.A = problem_.less_movement * movement_ * scales_.cwiseInverse().asDiagonal();
    problem.c = problem_.less_movement * movement_rest_;
    problem.lower.resize(n);
    problem.upper.resize(n);
    problem.steps.resize(n);
    for (Index i = 0; i < n; ++i) {
      const FitUnknown& unknown = problem_.unknowns[static_cast<size_t>(i)];
      problem.lower[i] = unknown.lower * scales_[i];
      problem.upper[i] = unknown.upper * scales_[i];
      problem.steps[i] = (unknown.is_rotation ? kRotationStep : kTranslationStepMm) * scales_[i];
    }
    problem.smallest_move = 1e-5;  // mm of bone, as good as single precision
    LeastSquaresSolution solution = SolveBoundedLeastSquares(problem, start);
    fit->iterations += solution.iterations;
    fit->converged = solution.converged;
    return solution;
  }

  void Tell(const LeastSquaresSolution& solution, const VectorXd& reached,
            const Positions& positions, PlanFit* fit) const {
    fit->poses = PosesOf(solution.x);
    const MatrixXd jacobian = solution.jacobian * scales_.asDiagonal();  // by rad and mm
    FitQuality quality =
        MeasureFitQuality(jacobian, movement_, solution.bounds, problem_.less_movement);
    for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
      const double value = solution.x[static_cast<Index>(i)] / scales_[static_cast<Index>(i)];
      fit->unknowns.push_back({value, solution.bounds[i], quality.unknowns[i]});
    }
    fit->directions = std::move(quality.directions);
    fit->contradictions = FindContradictions(problem_, solution.jacobian, reached - wanted_);
    fit->movement_mm = MovementOf(solution.x);
    Index row = 0;
    for (size_t t = 0; t < problem_.targets.size(); ++t) {
      const Index count = problem_.targets[t].along.rows();
      const VectorXd part = reached.segment(row, count);
      fit->targets.push_back({part, (part - wanted_.segment(row, count)).norm(),
                              PositionOf(chosen_points_[t], positions)});
      row += count;
    }
  }

  double MovementOf(const VectorXd& x) const {
    const VectorXd all = movement_ * x.cwiseQuotient(scales_) + movement_rest_;
    double weighted = 0;
    double vertices = 0;
    std::vector<bool> counted(problem_.poses.size(), false);
    for (const FitUnknown& unknown : problem_.unknowns) {
      if (counted[unknown.handle]) continue;
      counted[unknown.handle] = true;
      const auto count =
          static_cast<double>(constraints_.handles()[unknown.handle].vertices.size());
      weighted += count * all.segment<6>(6 * static_cast<Index>(unknown.handle)).squaredNorm();
      vertices += count;
    }
    return std::sqrt(weighted / vertices);
  }

  const FitProblem& problem_;
  const TetMesh& mesh_;
  const ConstraintSet& constraints_;
  const VertexResponse& response_;
  const FitOptions& options_;
  const std::vector<int32_t> vertices_;
  std::vector<MeshPoint> chosen_points_;  // by places in vertices_
  VectorXd wanted_;                       // of all rows
  VectorXd root_weights_;
  MatrixXd movement_;  // by rad and mm
  VectorXd movement_rest_;
  VectorXd scales_;  // of the unknowns of the search, in mm of movement for a rad or a mm
};

}  // namespace

std::vector<int32_t> FitVertices(const FitProblem& problem) {
  std::vector<int32_t> vertices;
  for (const FitTarget& target : problem.targets) {
    vertices.insert(vertices.end(), target.point.vertices.begin(), target.point.vertices.end());
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

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
  return largest + kRotationStep;
}

absl::StatusOr<PlanFit> FitPlan(const FitProblem& problem, const TetMesh& mesh,
                                const ConstraintSet& constraints, const VertexResponse& response,
                                const FitOptions& options) {
  return Fitting(problem, mesh, constraints, response, options).Run();
}

}  // namespace tissueform
