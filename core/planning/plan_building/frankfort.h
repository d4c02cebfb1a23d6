// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mechanics/constraints/head_frame.h"

namespace tissueform {

// What the Frankfort horizontal goes through.
struct FrankfortLandmarks {
  LeftAndRight porion;    // top of the outer ear canal, where it is bony
  LeftAndRight orbitale;  // lowest of the rim of the eye's socket
};

// Found in the CT about the landmarks of the jaws, good to 2 or 3 mm: the ear canal is the air
// nearest behind the jaw's joint, the rim of the socket is where bone, looked at from the front,
// comes forward below a pit.
//
// Nothing where one of the four is not in view, or where they do not agree with each other as those
// of a head do: both sides within kMaxSideDifferenceMm, ears 55 to 100 mm behind the eyes, and the
// horizontal up to 25 degrees over the upper teeth. Who gets nothing says so and does without.
std::optional<FrankfortLandmarks> FindFrankfort(const HuGrid& hu, int16_t bone_above_hu,
                                                const Landmarks& landmarks);
inline constexpr double kMaxSideDifferenceMm = 6;

// Through the middle of the porions and of the orbitalia, square to the midsagittal plane: a cant
// of one side is not taken over. Normal up.
Plane FrankfortHorizontal(const FrankfortLandmarks& frankfort, const Plane& midsagittal);

// The frame of the two planes: left is the normal of the midsagittal one, superior that of the
// horizontal as far as it is square to it. REQUIRES: they are not parallel.
HeadFrame FrameOfPlanes(const Plane& midsagittal, const Plane& horizontal);

// What a head's frame is made from: planes that the user has given, and what was found.
struct HeadFrameSources {
  const Landmarks& landmarks;
  const std::optional<FrankfortLandmarks>& frankfort;
  const std::optional<Plane>& given_midsagittal;
  const std::optional<Plane>& given_horizontal;
};

// A given plane comes before a found one. Without a horizontal it is the scanner's, through the
// jaws' joints: then only left and right are the patient's.
//
// Errors: InvalidArgument: given planes are nearly parallel, or face the wrong way (left is where x
// grows, up where z grows, within 60 degrees).
absl::StatusOr<HeadFrame> ChooseHeadFrame(const HeadFrameSources& sources);

}  // namespace tissueform
