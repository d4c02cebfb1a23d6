// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "google/protobuf/repeated_ptr_field.h"

#include "tissueform/v1/export_service.pb.h"

namespace tissueform {

// What a request may state about an export.
inline constexpr int kMaxMeasures = 64;
inline constexpr int kMaxMeasureNameBytes = 64;
inline constexpr int kMaxMeasureTitleBytes = 64;
inline constexpr int kMaxExportDetailBytes = 256;

// "exports/{id}" from the id and back. Errors: InvalidArgument.
std::string ExportName(absl::string_view id);
absl::StatusOr<std::string> ParseExportName(absl::string_view name);

// OK for measures that may be kept: names once each, of a-z, 0-9 and "_"; titles without control
// characters; "mm" or "deg"; finite numbers, the range in order. Errors: InvalidArgument, by their
// number and without their titles.
absl::Status CheckMeasures(const google::protobuf::RepeatedPtrField<v1::Measure>& measures);

// OK for what a bridge may report. Errors: InvalidArgument, without it.
absl::Status CheckExportDetail(absl::string_view detail);

// "waiting", "waits for confirmation", "storing", "stored", "failed": for people.
absl::string_view ExportStateText(v1::ExportState state);

// Equal for equal requests, the request_id apart.
std::string RequestFingerprint(const v1::CreateExportRequest& request);

}  // namespace tissueform
