// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/resource_text.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "absl/time/time.h"

namespace tissueform {

std::string TimeText(const google::protobuf::Timestamp& time) {
  return absl::FormatTime("%Y-%m-%d %H:%M:%S", absl::FromUnixSeconds(time.seconds()),
                          absl::LocalTimeZone());
}

std::string UtcTimeText(const google::protobuf::Timestamp& time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::FromUnixSeconds(time.seconds()),
                          absl::UTCTimeZone());
}

std::string ModelText(v1::DeformationModel model) {
  return absl::AsciiStrToLower(
      absl::StripPrefix(v1::DeformationModel_Name(model), "DEFORMATION_MODEL_"));
}

std::string FullName(const std::string& collection, const std::string& name) {
  const std::string prefix = collection + "/";
  return absl::StartsWith(name, prefix) ? name : absl::StrCat(prefix, name);
}

}  // namespace tissueform
