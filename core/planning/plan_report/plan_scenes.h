// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What the 3-D pictures of a report show, each seen from several sides. Patient coordinates, LPS.

// The bone: what stays and the segments, as isosurfaces of the labels. Pieces under 1 cm3 are left
// out. Errors: those of ExtractSurface.
absl::StatusOr<std::vector<Scene>> BoneScenes(const PlanBuild& build);

// The boundary of the mesh with the named regions of the skin.
std::vector<Scene> SkinScenes(const PlanBuild& build);

// Where the mesh lies on bone, by what its vertices are: fixed, moved, or left free.
std::vector<Scene> ConstraintScenes(const PlanBuild& build);

// The tets behind a midsagittal cut and behind a coronal one through the lower molars, coloured by
// tissue.
std::vector<Scene> CutScenes(const PlanBuild& build);

}  // namespace tissueform
