// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/retry_times.h"

#include "core/base/error_reason.h"

namespace tissueform {

bool MayCome(const absl::Status& status) {
  // A peer that dies in a TLS handshake looks like one with a wrong certificate, and that may be
  // renewed, too.
  return IsTransient(status) || absl::IsDeadlineExceeded(status) || absl::IsCancelled(status) ||
         absl::IsUnauthenticated(status) || absl::IsPermissionDenied(status) ||
         HasReason(status, ErrorReason::kDiskFull);
}

}  // namespace tissueform
