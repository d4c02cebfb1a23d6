// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include <sys/types.h>

namespace tissueform {

// The X display that offscreen rendering needs: the one that DISPLAY names where that can be
// opened, otherwise an Xvfb of our own on a free display, to which DISPLAY then points. Ended, and
// DISPLAY put back, by the destructor. Changes the environment, so make it while there is one
// thread.
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

  pid_t server_ = 0;  // 0: the user's own display
  bool had_display_ = false;
  std::string former_display_;
};

}  // namespace tissueform
