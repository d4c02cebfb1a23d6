// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Whether the X display that the environment variable DISPLAY names can be opened. VTK ends the
// whole program when it cannot.
bool DisplayOpens();

}  // namespace tissueform
