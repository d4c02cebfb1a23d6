// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/cli/export/sealed_payload.h"

namespace tissueform {

// The page of files that move, which deploy/build_web.sh makes and which lies among the planner's
// files: share/tissueform/web beside this program. Errors: NotFound, with what to do.
absl::StatusOr<std::string> ReadPageTemplate();

// The page with envelope and payload in it. Errors: FailedPrecondition when that is no page of ours
// (each mark stands in it once).
absl::StatusOr<std::string> FillPageTemplate(absl::string_view page, const SealedPayload& sealed);

}  // namespace tissueform
