// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_unknowns.h"

#include <algorithm>
#include <cmath>

#include "core/mechanics/plan_fitting/handle_movement.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Answers are in single precision, 1e-5 mm on a head: a mm of movement gives slopes to that, and
// what three orders of half a degree put them off by is as little.
constexpr double kTranslationStepMm = 0.5;
// Handles without extent are taken for one of this radius, so that every unknown has a scale.
constexpr double kLeastRadiusMm = 0.1;

double& ComponentOf(const FitUnknown& unknown, HandlePose* pose) {
  return (unknown.is_rotation ? pose->rotation_vector : pose->translation_mm)[unknown.axis];
}

}  // namespace

FitUnknowns::FitUnknowns(const FitProblem& problem, const TetMesh& mesh,
                         const ConstraintSet& constraints)
    : problem_(problem) {
  const auto handles = static_cast<Index>(problem.poses.size());
  const auto n = static_cast<Index>(problem.unknowns.size());
  movement_.setZero(6 * handles, n);
  movement_rest_.setZero(6 * handles);
  handle_weights_.setZero(handles);
  scales_.setOnes(n);
  for (Index i = 0; i < n; ++i) {
    const FitUnknown& unknown = problem.unknowns[static_cast<size_t>(i)];
    const auto h = static_cast<Index>(unknown.handle);
    const std::vector<int32_t>& vertices = constraints.handles()[unknown.handle].vertices;
    const Eigen::Matrix<double, 6, 6> root =
        MovementRoot(mesh, vertices, problem.poses[unknown.handle].pivot_mm);
    const int component = unknown.axis + (unknown.is_rotation ? 0 : 3);
    movement_.block<6, 1>(6 * h, i) = unknown.sign * root.col(component);
    scales_[i] = std::max(movement_.col(i).norm(), unknown.is_rotation ? kLeastRadiusMm : 1.0);
    HandlePose rest = problem.poses[unknown.handle];
    for (const FitUnknown& other : problem.unknowns) {
      if (other.handle == unknown.handle) ComponentOf(other, &rest) = 0;
    }
    movement_rest_.segment<6>(6 * h) =
        root.leftCols<3>() * rest.rotation_vector + root.rightCols<3>() * rest.translation_mm;
    handle_weights_[h] = static_cast<double>(vertices.size());
  }
}

std::vector<HandlePose> FitUnknowns::PosesOf(const VectorXd& x) const {
  std::vector<HandlePose> poses = problem_.poses;
  for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
    const FitUnknown& unknown = problem_.unknowns[i];
    ComponentOf(unknown, &poses[unknown.handle]) =
        unknown.sign * x[static_cast<Index>(i)] / scales_[static_cast<Index>(i)];
  }
  return poses;
}

VectorXd FitUnknowns::Start() const {
  VectorXd x(scales_.size());
  for (size_t i = 0; i < problem_.unknowns.size(); ++i) {
    const FitUnknown& unknown = problem_.unknowns[i];
    HandlePose pose = problem_.poses[unknown.handle];
    x[static_cast<Index>(i)] =
        unknown.sign * ComponentOf(unknown, &pose) * scales_[static_cast<Index>(i)];
  }
  return x;
}

void FitUnknowns::Describe(LeastSquaresProblem* search) const {
  search->A = problem_.less_movement * movement_ * scales_.cwiseInverse().asDiagonal();
  search->c = problem_.less_movement * movement_rest_;
  search->lower.resize(scales_.size());
  search->upper.resize(scales_.size());
  search->steps.resize(scales_.size());
  for (Index i = 0; i < scales_.size(); ++i) {
    const FitUnknown& unknown = problem_.unknowns[static_cast<size_t>(i)];
    search->lower[i] = unknown.lower * scales_[i];
    search->upper[i] = unknown.upper * scales_[i];
    search->steps[i] = (unknown.is_rotation ? kFitRotationStep : kTranslationStepMm) * scales_[i];
  }
}

double FitUnknowns::MovementMm(const VectorXd& x) const {
  const VectorXd all = movement_ * x.cwiseQuotient(scales_) + movement_rest_;
  double sum = 0;
  for (Index h = 0; h < handle_weights_.size(); ++h) {
    sum += handle_weights_[h] * all.segment<6>(6 * h).squaredNorm();
  }
  return std::sqrt(sum / handle_weights_.sum());
}

}  // namespace tissueform
