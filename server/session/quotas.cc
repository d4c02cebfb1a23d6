// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/quotas.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"

namespace tissueform {

absl::Status QuotaExceeded(absl::string_view what, absl::string_view name, int64_t limit,
                           std::chrono::steady_clock::duration try_again_after) {
  const int64_t wait_ms = std::max<int64_t>(
      1, std::chrono::duration_cast<std::chrono::milliseconds>(try_again_after).count());
  return WithReason(
      absl::ResourceExhaustedError(absl::StrCat(
          "you have reached your quota of ", what, ", ", limit, " (--quota-", name,
          " of the server); end some, or try again in ", (wait_ms + 999) / 1000, " s")),
      ErrorReason::kQuotaExceeded,
      {{"quota", std::string(name)},
       {"limit", absl::StrCat(limit)},
       {"retry_after_ms", absl::StrCat(wait_ms)}});
}

}  // namespace tissueform
