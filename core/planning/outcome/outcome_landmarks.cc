// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/outcome_landmarks.h"

#include <algorithm>
#include <array>
#include <optional>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/planning/outcome/published_ratios.h"
#include "core/planning/outcome/skin_profile.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Landmarks are looked for so far above and below where they are expected.
constexpr double kWindowMm = 5;

constexpr std::array<const char*, 4> kForemost = {"pronasale", "labrale_superius",
                                                  "labrale_inferius", "soft_pogonion"};

struct Fold {
  const char* name;
  const char* above;
  const char* below;
};
constexpr std::array<Fold, 3> kFolds = {{{"subnasale", "pronasale", "labrale_superius"},
                                         {"stomion", "labrale_superius", "labrale_inferius"},
                                         {"sublabiale", "labrale_inferius", "soft_pogonion"}}};

// The bone that leads a skin landmark. The nose tip is left out: no ratio of its height is known.
struct Lead {
  const char* skin;
  const char* bone;
  bool is_upper;
};
constexpr std::array<Lead, 5> kLeads = {{{"subnasale", "upper_incisor", true},
                                         {"labrale_superius", "upper_incisor", true},
                                         {"labrale_inferius", "lower_incisor", false},
                                         {"sublabiale", "pogonion", false},
                                         {"soft_pogonion", "pogonion", false}}};

double RatioOf(JawMove move, const char* skin) {
  const std::optional<PublishedRatio> ratio = FindPublishedRatio(move, skin);
  return ratio ? ratio->Middle() : 1;
}

// The bone landmark's movement; zero where it stays.
Vector3d BoneMovement(const char* bone, const CaseFile& contents,
                      const std::vector<SegmentMovement>& segments) {
  const auto landmark = std::ranges::find(contents.landmarks, bone, &CaseLandmark::name);
  if (landmark == contents.landmarks.end()) return Vector3d::Zero();
  const auto segment = std::ranges::find(segments, landmark->handle, &SegmentMovement::handle);
  if (segment == segments.end()) return Vector3d::Zero();
  return ApplyPose(segment->real, landmark->position_mm) - landmark->position_mm;
}

}  // namespace

PlacedLandmarks LandmarksOf(const CaseFile& contents) {
  PlacedLandmarks places;
  for (const CaseLandmark& landmark : contents.landmarks) {
    if (landmark.skin_vertex) places[landmark.name] = landmark.position_mm;
  }
  return places;
}

PlacedLandmarks FindOnProfile(const Positions& positions, const TriangleIndices& triangles,
                              const HeadFrame& frame, const PlacedLandmarks& near) {
  const SkinProfile profile(positions, triangles, frame);
  PlacedLandmarks found;
  for (const char* name : kForemost) {
    if (!near.contains(name)) continue;
    const double height = profile.HeightOf(near.at(name));
    const auto place = profile.Foremost(height - kWindowMm, height + kWindowMm);
    if (place) found[name] = *place;
  }
  for (const Fold& fold : kFolds) {
    if (!found.contains(fold.above) || !found.contains(fold.below)) continue;
    const auto place =
        profile.Deepest(profile.HeightOf(found[fold.above]), profile.HeightOf(found[fold.below]));
    if (place) found[fold.name] = *place;
  }
  return found;
}

std::vector<LandmarkComparison> CompareLandmarks(const PlacedLandmarks& before,
                                                 const PlacedLandmarks& predicted,
                                                 const PlacedLandmarks& real,
                                                 const HeadFrame& frame) {
  std::vector<LandmarkComparison> comparisons;
  for (const auto& [name, place] : before) {
    if (!predicted.contains(name) || !real.contains(name)) continue;
    const Vector3d by_prediction = predicted.at(name) - place;
    const Vector3d in_truth = real.at(name) - place;
    comparisons.push_back({.name = name,
                           .predicted_forward_mm = -frame.posterior.dot(by_prediction),
                           .predicted_up_mm = frame.superior.dot(by_prediction),
                           .real_forward_mm = -frame.posterior.dot(in_truth),
                           .real_up_mm = frame.superior.dot(in_truth),
                           .error_mm = (by_prediction - in_truth).norm()});
  }
  return comparisons;
}

PlacedLandmarks PredictedByRatios(const PlacedLandmarks& before, const CaseFile& contents,
                                  const std::vector<SegmentMovement>& segments) {
  PlacedLandmarks places;
  const HeadFrame& frame = contents.head_frame;
  for (const Lead& lead : kLeads) {
    if (!before.contains(lead.skin)) continue;
    const Vector3d bone_mm = BoneMovement(lead.bone, contents, segments);
    const double forward_mm = -frame.posterior.dot(bone_mm);
    const double up_mm = frame.superior.dot(bone_mm);
    const JawMove lower = forward_mm > 0 ? JawMove::kMandibleForward : JawMove::kMandibleBack;
    const double forward_ratio =
        RatioOf(lead.is_upper ? JawMove::kMaxillaForward : lower, lead.skin);
    const double up_ratio = lead.is_upper ? RatioOf(JawMove::kMaxillaUp, lead.skin) : 1;
    places[lead.skin] = before.at(lead.skin) - forward_ratio * forward_mm * frame.posterior +
                        up_ratio * up_mm * frame.superior;
  }
  return places;
}

}  // namespace tissueform
