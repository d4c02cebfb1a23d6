// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Is it one whole head, the way up that the CT says? Checks beside those of the stages, and what
// can be said of a CT in which a stage has not found what a head has.

// Errors: InvalidArgument when there is a second lower jaw, in this body or in another one: two
// heads, with the place of either jaw.
absl::Status CheckOneHead(const HuGrid& ct, const HeadSegmentation& head, const BoneParts& parts);

// Whether the landmarks lie to each other as in a head that stands upright in LPS, within the
// bounds of any adult and of a head bent back by 20 degrees.
//
// Errors: InvalidArgument that says which do not.
absl::Status CheckLandmarks(const Landmarks& landmarks);

// `error` is of a stage that has not found what a head has. Looks for the reason: whether a lower
// jaw is there when the head is turned by quarters (then it does not lie as the CT says), whether
// only half a head is in view, whether there is metal enough to hide the teeth (which the plane of
// the recipe helps with). InvalidArgument with that reason (a turn and metal beside `error`, as
// they may be wrong guesses), or `error` itself.
absl::Status ExplainMissingAnatomy(const HeadSegmentation& head, bool occlusal_plane_given,
                                   const absl::Status& error);

}  // namespace tissueform
