// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// A file of its own: Xlib.h defines macros such as Status.

#include "client/rendering/display_check.h"

#include <X11/Xlib.h>

namespace tissueform {

bool DisplayOpens() {
  Display* display = XOpenDisplay(nullptr);
  if (display == nullptr) return false;
  XCloseDisplay(display);
  return true;
}

}  // namespace tissueform
