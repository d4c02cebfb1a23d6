// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "core/base/process/guarded_program.h"

namespace tissueform {

// Whether the X display that the environment variable DISPLAY names can be opened. VTK ends the
// whole program when it cannot.
bool DisplayOpens();

// The X display that offscreen rendering needs: the one that DISPLAY names where that can be
// opened, otherwise an Xvfb of our own on a free display, to which DISPLAY then points. Ended, and
// DISPLAY put back, by the destructor; it also ends when this process does, for any reason. Changes
// the environment, so make it while no other thread may read that.
//
// Errors: NotFound when there is no usable display and Xvfb is not installed, Unavailable when it
// does not start.
class VirtualDisplay {
 public:
  static absl::StatusOr<std::unique_ptr<VirtualDisplay>> Open();
  ~VirtualDisplay();
  VirtualDisplay(const VirtualDisplay&) = delete;
  VirtualDisplay& operator=(const VirtualDisplay&) = delete;

 private:
  VirtualDisplay() = default;
  absl::Status Start();

  std::unique_ptr<GuardedProgram> server_;  // null: the user's own display
  std::optional<std::string> former_display_;
};

}  // namespace tissueform
