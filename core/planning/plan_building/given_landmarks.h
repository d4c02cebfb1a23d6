// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/imaging/anatomy/landmarks.h"
#include "core/planning/plan_building/frankfort.h"

namespace tissueform {

// Landmarks that a recipe gives, by the names that viewers show (viewer_landmarks.h). LPS, mm.
using GivenLandmarks = std::map<std::string, Eigen::Vector3d>;

// The name that a label of a markups file means: the name itself in any case, with spaces for
// underscores, or its usual abbreviation ("Pog", "Me", "Go_L", "Or R"). Empty: none.
std::string LandmarkNameOf(absl::string_view label);

// All names, for messages.
std::string LandmarkNames();

// Puts given landmarks in place of found ones. Planes through the teeth follow the given teeth.
// Porions and orbitalia count only together: where they were not found, all four must be given.
// Adds a note on what was given.
//
// Errors: InvalidArgument for an unknown name, or a point more than 20 mm from where the CT shows
// it, as of another patient or in other axes.
absl::Status PlaceLandmarks(const GivenLandmarks& given, Landmarks* landmarks,
                            std::optional<FrankfortLandmarks>* frankfort,
                            std::vector<std::string>* notes);

}  // namespace tissueform
