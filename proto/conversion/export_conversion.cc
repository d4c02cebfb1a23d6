// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/export_conversion.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

constexpr absl::string_view kExportPrefix = "exports/";
constexpr size_t kMaxExportIdBytes = 64;

bool IsExportId(absl::string_view id) {
  return !id.empty() && id.size() <= kMaxExportIdBytes &&
         std::all_of(id.begin(), id.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '-'; });
}

bool IsMeasureName(absl::string_view name) {
  return !name.empty() && name.size() <= static_cast<size_t>(kMaxMeasureNameBytes) &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '_';
         });
}

bool HoldsControls(absl::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return absl::ascii_iscntrl(c); });
}

// Empty: nothing.
absl::string_view WhatIsWrong(const v1::Measure& measure) {
  if (!IsMeasureName(measure.name())) return "has an invalid name";
  if (measure.title().size() > static_cast<size_t>(kMaxMeasureTitleBytes) ||
      HoldsControls(measure.title())) {
    return "has a title that is too long or has control characters";
  }
  if (measure.unit() != "mm" && measure.unit() != "deg") return "has a unit other than mm and deg";
  const bool finite = std::isfinite(measure.before()) && std::isfinite(measure.after()) &&
                      std::isfinite(measure.lowest_after()) &&
                      std::isfinite(measure.highest_after());
  if (!finite) return "has a number that is not finite";
  if (measure.has_lowest_after() != measure.has_highest_after() ||
      measure.lowest_after() > measure.highest_after()) {
    return "has an incomplete or reversed interval";
  }
  return "";
}

}  // namespace

std::string ExportName(absl::string_view id) { return absl::StrCat(kExportPrefix, id); }

absl::StatusOr<std::string> ParseExportName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kExportPrefix) || !IsExportId(name)) {
    return absl::InvalidArgumentError(
        "invalid export name; use the name that CreateExport returned, \"exports/{id}\"");
  }
  return std::string(name);
}

absl::Status CheckMeasures(const google::protobuf::RepeatedPtrField<v1::Measure>& measures) {
  if (measures.size() > kMaxMeasures) {
    return absl::InvalidArgumentError(absl::StrCat("the request has ", measures.size(),
                                                   " measures; the limit is ", kMaxMeasures));
  }
  std::set<absl::string_view> names;
  for (int i = 0; i < measures.size(); ++i) {
    absl::string_view wrong = WhatIsWrong(measures[i]);
    if (wrong.empty() && !names.insert(measures[i].name()).second) {
      wrong = "repeats an earlier name";
    }
    if (!wrong.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("measure ", i, " ", wrong, "; remove it"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckExportDetail(absl::string_view detail) {
  if (detail.size() <= static_cast<size_t>(kMaxExportDetailBytes) && !HoldsControls(detail)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the detail has over ", kMaxExportDetailBytes,
                   " bytes or has control characters; write one short line"));
}

absl::string_view ExportStateText(v1::ExportState state) {
  switch (state) {
    case v1::EXPORT_STATE_WAITING:
      return "waiting";
    case v1::EXPORT_STATE_CONFIRMATION:
      return "waits for confirmation";
    case v1::EXPORT_STATE_STORING:
      return "storing";
    case v1::EXPORT_STATE_STORED:
      return "stored";
    case v1::EXPORT_STATE_FAILED:
      return "failed";
    default:
      return "unknown";
  }
}

std::string RequestFingerprint(const v1::CreateExportRequest& request) {
  v1::CreateExportRequest without_id = request;
  without_id.clear_request_id();
  return MessageFingerprint(without_id);
}

}  // namespace tissueform
