// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include "core/planning/rendering/panels.h"

namespace tissueform {

// Half the height, in mm, that the view of a scene must have to hold all of it in a panel of
// `aspect` (width by height).
double HalfHeightToHold(const Scene& scene, double aspect);

// The scene in the middle of its panel, `half_height_mm` up and down.
vtkSmartPointer<vtkRenderer> RenderScene(const Scene& scene, double half_height_mm);

}  // namespace tissueform
