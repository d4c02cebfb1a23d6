// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include "core/planning/rendering/panels.h"

namespace tissueform {

// The chart, filling its panel.
vtkSmartPointer<vtkRenderer> RenderChart(const Chart& chart);

}  // namespace tissueform
