// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// How resources, principals and projects are called in shares.
namespace tissueform {

inline constexpr char kSessionsPrefix[] = "sessions/";
inline constexpr char kPredictionsPrefix[] = "predictions/";
inline constexpr char kCasesPrefix[] = "cases/";
inline constexpr char kProjectsPrefix[] = "projects/";

inline std::string SessionResource(const std::string& id) {
  return std::string(kSessionsPrefix) + id;
}
inline std::string PredictionResource(const std::string& id) {
  return std::string(kPredictionsPrefix) + id;
}
inline std::string CaseResource(const std::string& sha256) {
  return std::string(kCasesPrefix) + sha256;
}
inline std::string ProjectResource(const std::string& name) {
  return std::string(kProjectsPrefix) + name;
}

// InvalidArgument unless it is 1 to 128 bytes of printable ASCII. `what` is said in the message.
absl::Status CheckAccessName(absl::string_view name, absl::string_view what);

}  // namespace tissueform
