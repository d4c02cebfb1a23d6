// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

inline constexpr size_t kMaxBuildRecipeBytes = size_t{1} << 20;
inline constexpr int kMaxRecipeFiles = 256;

std::string BuildFileName(absl::string_view sha256);
// The SHA-256. InvalidArgument for what is no such name.
absl::StatusOr<std::string> ParseBuildFileName(absl::string_view name);

std::string PlanBuildName(absl::string_view id);
// The id. InvalidArgument for what is no such name.
absl::StatusOr<std::string> ParsePlanBuildName(absl::string_view name);

std::string BuildDraftName(absl::string_view id);
// The id. InvalidArgument for what is no such name.
absl::StatusOr<std::string> ParseBuildDraftName(absl::string_view name);
// Whether it is a request at all: the name of a file, a title and a recipe that are not too long.
absl::Status CheckBuildDraftRequest(const v1::CreateBuildDraftRequest& request);

// Whether it is a request at all: a recipe and a CT or surfaces, names of build files, plain paths,
// and texts that are not too long. The recipe itself is read by the program that builds.
absl::Status CheckPlanBuildRequest(const v1::CreatePlanBuildRequest& request);

}  // namespace tissueform
