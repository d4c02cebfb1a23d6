// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include "core/planning/rendering/panels.h"

namespace tissueform {

// The picture as large as it fits below the title of a panel of `aspect` (width by height).
vtkSmartPointer<vtkRenderer> RenderPicture(const Picture& picture, double aspect);

}  // namespace tissueform
