// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <utility>

#include "absl/status/status.h"

namespace tissueform {

// Whether a caller still waits for the result of long work: passed down to the work, which asks it
// between stages. Cheap to copy; its function must outlive the work and be safe on its thread.
class Cancellation {
 public:
  // Never.
  Cancellation() = default;
  explicit Cancellation(std::function<bool()> requested) : requested_(std::move(requested)) {}

  bool requested() const { return requested_ && requested_(); }

  // Cancelled once it is requested.
  absl::Status Check() const {
    return requested() ? absl::CancelledError("the caller canceled the work") : absl::OkStatus();
  }

 private:
  std::function<bool()> requested_;
};

}  // namespace tissueform
