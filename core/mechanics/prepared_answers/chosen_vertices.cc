// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/chosen_vertices.h"

#include <algorithm>
#include <cstring>

namespace tissueform {
namespace {

constexpr int kFree = -2;
constexpr double kHalfUnit = 5.97e-8;  // 2^-24, and a little for what doubles lose

// Of every vertex of the mesh: its handle, ConstraintSet::kFixed or kFree.
std::vector<int> RegionsOf(Eigen::Index num_vertices, const ConstraintSet& constraints) {
  std::vector<int> regions(static_cast<size_t>(num_vertices), kFree);
  for (size_t i = 0; i < constraints.constrained().size(); ++i) {
    regions[static_cast<size_t>(constraints.constrained()[i])] =
        constraints.region_of_constrained()[i];
  }
  return regions;
}

Positions RowsAt(const Positions& rest, const std::vector<int32_t>& vertices,
                 const std::vector<int32_t>& places) {
  Positions rows(static_cast<Eigen::Index>(places.size()), 3);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    rows.row(i) = rest.row(vertices[static_cast<size_t>(places[static_cast<size_t>(i)])]);
  }
  return rows;
}

}  // namespace

ChosenVertices::ChosenVertices(const Positions& rest, const ConstraintSet& constraints,
                               const std::vector<int32_t>& vertices)
    : size_(static_cast<Eigen::Index>(vertices.size())), handles_(constraints.handles().size()) {
  const std::vector<int> regions = RegionsOf(rest.rows(), constraints);
  for (int32_t place = 0; place < size_; ++place) {
    const int region = regions[static_cast<size_t>(vertices[static_cast<size_t>(place)])];
    if (region >= 0) {
      handles_[static_cast<size_t>(region)].places.push_back(place);
    } else if (region == ConstraintSet::kFixed) {
      fixed_places_.push_back(place);
    } else {
      const bool goes_on = !free_.empty() && free_.back().place + free_.back().count == place;
      if (!goes_on) free_.push_back({.place = place});
      ++free_.back().count;
      ++num_free_;
    }
  }
  const Positions fixed = RowsAt(rest, vertices, fixed_places_);
  fixed_rest_ = fixed.cast<float>();
  if (fixed.rows() > 0) largest_fixed_ = fixed.rowwise().norm().maxCoeff();
  for (Handle& handle : handles_) {
    handle.rest = RowsAt(rest, vertices, handle.places);
    if (handle.places.empty()) continue;
    handle.middle = handle.rest.colwise().mean().transpose();
    handle.radius = (handle.rest.rowwise() - handle.middle.transpose()).rowwise().norm().maxCoeff();
  }
}

std::vector<int32_t> ChosenVertices::FreeAmong(const std::vector<int32_t>& vertices) const {
  std::vector<int32_t> free;
  free.reserve(static_cast<size_t>(num_free_));
  for (const Run& run : free_) {
    free.insert(free.end(), vertices.begin() + run.place, vertices.begin() + run.place + run.count);
  }
  return free;
}

void ChosenVertices::Complete(absl::Span<const HandlePose> poses, FloatPositions* positions) const {
  // No place lies before the row that goes there, so from the last one on nothing is lost.
  Eigen::Index end = num_free_;
  for (auto run = free_.rbegin(); run != free_.rend(); ++run) {
    end -= run->count;
    std::memmove(positions->row(run->place).data(), positions->row(end).data(),
                 static_cast<size_t>(run->count) * 3 * sizeof(float));
  }
  for (size_t i = 0; i < fixed_places_.size(); ++i) {
    positions->row(fixed_places_[i]) = fixed_rest_.row(static_cast<Eigen::Index>(i));
  }
  for (size_t h = 0; h < handles_.size(); ++h) {
    const HandlePose& pose = poses[h];
    // Written for displacements: identity poses give rest.
    const Eigen::Matrix3d turn =
        pose.scale * RotationMatrix(pose.rotation_vector) - Eigen::Matrix3d::Identity();
    const Eigen::Vector3d move = pose.translation_mm - turn * pose.pivot_mm;
    for (size_t i = 0; i < handles_[h].places.size(); ++i) {
      const Eigen::Vector3d rest = handles_[h].rest.row(static_cast<Eigen::Index>(i)).transpose();
      positions->row(handles_[h].places[i]) =
          (rest + (turn * rest + move)).transpose().cast<float>();
    }
  }
}

double ChosenVertices::RoundingBoundMm(absl::Span<const HandlePose> poses) const {
  double largest = largest_fixed_;
  for (size_t h = 0; h < handles_.size(); ++h) {
    if (handles_[h].places.empty()) continue;
    largest = std::max(largest, ApplyPose(poses[h], handles_[h].middle).norm() +
                                    poses[h].scale * handles_[h].radius);
  }
  return kHalfUnit * largest;
}

void ChosenVertices::Describe(PortableAnswers* answers) const {
  answers->numbers.num_vertices = static_cast<double>(size_);
  answers->numbers.num_handles = static_cast<double>(handles_.size());
  answers->regions.assign(static_cast<size_t>(size_), PortableAnswers::kFree);
  answers->fixed_rest.assign(fixed_rest_.data(), fixed_rest_.data() + fixed_rest_.size());
  for (const int32_t place : fixed_places_) {
    answers->regions[static_cast<size_t>(place)] = PortableAnswers::kFixed;
  }
  // Here handle by handle, there in the order of the answer.
  std::vector<Eigen::RowVector3d> rest(static_cast<size_t>(size_));
  for (size_t h = 0; h < handles_.size(); ++h) {
    for (size_t i = 0; i < handles_[h].places.size(); ++i) {
      const auto place = static_cast<size_t>(handles_[h].places[i]);
      answers->regions[place] = static_cast<int32_t>(h);
      rest[place] = handles_[h].rest.row(static_cast<Eigen::Index>(i));
    }
  }
  for (size_t place = 0; place < rest.size(); ++place) {
    if (answers->regions[place] < 0) continue;
    answers->handle_rest.insert(answers->handle_rest.end(), rest[place].begin(), rest[place].end());
  }
}

int64_t ChosenVertices::bytes_held() const {
  size_t bytes = free_.size() * sizeof(Run) + fixed_places_.size() * sizeof(int32_t) +
                 static_cast<size_t>(fixed_rest_.size()) * sizeof(float);
  for (const Handle& handle : handles_) {
    bytes += handle.places.size() * sizeof(int32_t) +
             static_cast<size_t>(handle.rest.size()) * sizeof(double) + sizeof(Handle);
  }
  return static_cast<int64_t>(bytes);
}

}  // namespace tissueform
