// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/skin_profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissueform {
namespace {

constexpr double kStepMm = 0.25;
constexpr double kNone = -std::numeric_limits<double>::infinity();

}  // namespace

SkinProfile::SkinProfile(const Positions& positions, const TriangleIndices& triangles,
                         const HeadFrame& frame)
    : frame_(frame) {
  // Rows: left, posterior, superior of the frame's origin.
  const Positions local = (positions.rowwise() - frame.origin_mm.transpose()) * frame.ToLps();
  if (triangles.rows() == 0) return;
  low_mm_ = local.col(2).minCoeff();
  const double height_mm = local.col(2).maxCoeff() - low_mm_;
  fronts_.assign(static_cast<size_t>(height_mm / kStepMm) + 1, kNone);
  for (const auto& t : triangles.rowwise()) {
    Eigen::Matrix3d corners;
    corners << local.row(t[0]), local.row(t[1]), local.row(t[2]);
    if (corners.col(0).minCoeff() <= 0 && corners.col(0).maxCoeff() >= 0) AddTriangle(corners);
  }
}

// Rows of `corners`: one corner each. Its section with the plane is a segment, which is sampled at
// the heights of the outline.
void SkinProfile::AddTriangle(const Eigen::Matrix3d& corners) {
  std::vector<Eigen::Vector2d> ends;  // front, height
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d a = corners.row(k);
    const Eigen::Vector3d b = corners.row((k + 1) % 3);
    if ((a[0] < 0) == (b[0] < 0)) continue;
    const Eigen::Vector3d at = a + (b - a) * (a[0] / (a[0] - b[0]));
    ends.emplace_back(-at[1], at[2] - low_mm_);
  }
  if (ends.size() != 2) return;
  if (ends[0][1] > ends[1][1]) std::swap(ends[0], ends[1]);
  const double rise = ends[1][1] - ends[0][1];
  const auto last = static_cast<int>(fronts_.size()) - 1;
  const int begin = std::max(0, static_cast<int>(std::ceil(ends[0][1] / kStepMm)));
  const int end = std::min(last, static_cast<int>(std::floor(ends[1][1] / kStepMm)));
  for (int row = begin; row <= end; ++row) {
    const double part = rise > 0 ? (row * kStepMm - ends[0][1]) / rise : 0;
    double& front = fronts_[static_cast<size_t>(row)];
    front = std::max(front, ends[0][0] + part * (ends[1][0] - ends[0][0]));
  }
}

std::vector<size_t> SkinProfile::RowsBetween(double from_mm, double to_mm) const {
  std::vector<size_t> rows;
  for (size_t i = 0; i < fronts_.size(); ++i) {
    const double height = low_mm_ + kStepMm * static_cast<double>(i);
    if (height < std::min(from_mm, to_mm) || height > std::max(from_mm, to_mm)) continue;
    if (fronts_[i] != kNone) rows.push_back(i);
  }
  return rows;
}

Eigen::Vector3d SkinProfile::PlaceOf(size_t row) const {
  const double height = low_mm_ + kStepMm * static_cast<double>(row);
  return frame_.origin_mm - fronts_[row] * frame_.posterior + height * frame_.superior;
}

std::optional<Eigen::Vector3d> SkinProfile::Foremost(double from_mm, double to_mm) const {
  const std::vector<size_t> rows = RowsBetween(from_mm, to_mm);
  if (rows.empty()) return std::nullopt;
  return PlaceOf(*std::ranges::max_element(rows, {}, [this](size_t row) { return fronts_[row]; }));
}

std::optional<Eigen::Vector3d> SkinProfile::Deepest(double from_mm, double to_mm,
                                                    double least_mm) const {
  const std::vector<size_t> rows = RowsBetween(from_mm, to_mm);
  if (rows.size() < 3) return std::nullopt;
  const Eigen::Vector2d from(fronts_[rows.front()], kStepMm * static_cast<double>(rows.front()));
  const Eigen::Vector2d to(fronts_[rows.back()], kStepMm * static_cast<double>(rows.back()));
  const Eigen::Vector2d along = (to - from).normalized();  // upwards
  const auto depth = [&](size_t row) {
    const Eigen::Vector2d at(fronts_[row], kStepMm * static_cast<double>(row));
    return along[0] * (at - from)[1] - along[1] * (at - from)[0];
  };
  const size_t deepest = *std::ranges::max_element(rows, {}, depth);
  if (depth(deepest) < least_mm) return std::nullopt;
  return PlaceOf(deepest);
}

double SkinProfile::HeightOf(const Eigen::Vector3d& place) const {
  return frame_.superior.dot(place - frame_.origin_mm);
}

double SkinProfile::FrontOf(const Eigen::Vector3d& place) const {
  return -frame_.posterior.dot(place - frame_.origin_mm);
}

}  // namespace tissueform
