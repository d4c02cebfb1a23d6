// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/anatomy/face_axes.h"
#include "core/imaging/anatomy/face_relief.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"

namespace tissueform {

// Limits of an adult mouth, in mm. `left` and `up` are face coordinates (FaceAxes).
inline constexpr double kMouthLineSearchMm = 9;  // above and below the start
inline constexpr double kShallowNotchMm = 1.5;   // less is not distinguished from folds of the skin
inline constexpr double kMouthHalfWidthCapMm = 30;

// What the height is measured from at which the search begins.
enum class MouthStart {
  kUpperIncisors,  // 3 mm over the edge of the upper incisors
  kJawRidges,      // without upper front teeth: midway between the jaws in the midline
};

// Why the line ends at a corner.
enum class MouthCornerReason {
  kNotchEnds,    // the notch becomes shallower than 1.5 mm
  kNoNotch,      // no notch 20 mm from the midline, where every adult mouth has one, or too little
                 // of it is seen on that side: the corner is put 25 mm from the midline: unsure
  kCapped,       // the notch goes on; the corner is put 30 mm from the midline: unsure
  kSkinNotSeen,  // the CT does not show the skin farther out: unsure
};

struct MouthLinePoint {
  FaceCoordinates at;
  double notch_mm = 0;  // how far behind the chord between the two lips' fronts; 0 where parted
  bool parted = false;  // air parts the lips: the point lies midway between their edges

  // Whether the CT shows lips there.
  bool seen() const { return parted || notch_mm >= kShallowNotchMm; }
};

// The line between the lips on the skin.
struct MouthLine {
  // From the right corner to the left one, 1 mm apart along `left`: at the bottom of the notch
  // between the lips, on the CT's skin. The first and the last point are the corners.
  std::vector<MouthLinePoint> points;
  MouthCornerReason right_corner = MouthCornerReason::kNotchEnds;
  MouthCornerReason left_corner = MouthCornerReason::kNotchEnds;
  MouthStart start = MouthStart::kUpperIncisors;
  double start_up = 0;      // face coordinate of the start
  double seen_share = 0;    // of the points
  double parted_share = 0;  // of the points
  bool near_metal = false;  // metal within 25 mm of a point: streaks may blur the skin
  bool given = false;       // by a person: the rest is not known, and the line is sure

  // Whether 80 % of the line are seen.
  bool line_is_sure() const;
};

// The line on a relief, by dynamic programming over its columns: the path within 9 mm of
// `start_up` with the deepest notch and few steps. Parted lips are followed midway between their
// edges; the upper one ends within those 9 mm, the lower one begins at most 30 mm below the start.
//
// Errors: InvalidArgument when the relief shows no skin in the midline within those 9 mm.
absl::StatusOr<MouthLine> FindMouthLine(const FaceRelief& relief, double start_up);

// The same on the skin of a head. Objects that were removed from it, such as tubes, are not skin;
// nor is the end of the scanner's field of view.
//
// Errors: those of FindMouthLine.
absl::StatusOr<MouthLine> FindMouthLine(const HeadSegmentation& head, const Landmarks& landmarks);

// A line that a person gives, LPS, from right to left.
//
// Errors: InvalidArgument unless each of its points, three or more, lies 0.5 mm or more left of the
// one before and all lie within 45 mm of the midline and 25 mm of the upper incisors' height.
absl::StatusOr<MouthLine> MouthLineThrough(const std::vector<Eigen::Vector3d>& places_mm,
                                           const Landmarks& landmarks);

// What was found and how sure it is, in sentences for a report: the line, then each corner.
std::vector<std::string> DescribeMouthLine(const MouthLine& line);

}  // namespace tissueform
