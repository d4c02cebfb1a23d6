// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// As in tissueform.v1; forward only, but for a patient who turns out to be another one (MayFollow).
enum class ExportState { kWaiting = 1, kConfirmation, kStoring, kStored, kFailed };

inline bool IsDone(ExportState state) {
  return state == ExportState::kStored || state == ExportState::kFailed;
}

// What is kept of an export.
struct ExportRecord {
  std::string id = {};  // rises with the creation
  std::string prediction = {};
  std::string case_sha256 = {};
  std::string owner = {};  // of the prediction, who asked for it
  ExportState state = ExportState::kWaiting;
  std::string detail = {};
  int32_t stored_objects = 0;
  int64_t created_s = 0;  // unix seconds
  int64_t updated_s = 0;
  int64_t version = 1;  // rises with every change
  // SHA-256 of what the client called its request, and of the request; empty: it called it nothing.
  std::string request_key = {};
  std::string request_fingerprint = {};
  std::string measures = {};  // the server's bytes
  // Random, new with every change: two servers that write the same words in the same second do not
  // write the same record.
  std::string change = {};

  friend bool operator==(const ExportRecord&, const ExportRecord&) = default;
};

std::string SerializeExport(const ExportRecord& record);
// Errors: DataLoss, for bytes that are not a record.
absl::StatusOr<ExportRecord> ParseExport(absl::string_view bytes);

// Whether an export may come from one state into another: into the same one, forward from one that
// is not done, or from storing back to confirmation: the PACS names another patient by then than
// the person has seen.
bool MayFollow(ExportState before, ExportState after);

// Aborted (STALE_ETAG): another caller has changed it.
absl::Status StaleExport(absl::string_view id);
absl::Status NoExport(absl::string_view id);  // NotFound

}  // namespace tissueform
