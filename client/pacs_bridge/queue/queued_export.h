// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

#include "server/platform/storage/database.h"

namespace tissueform {

// How far an export has come; one step after the other, each of which may be repeated.
enum class BridgeExportState {
  kAsked,      // its patient is shown in the review page
  kConfirmed,  // by a person
  kFetched,    // the patient's header is there, and says what the person has seen
  kWritten,    // all objects lie in its folder
  kSent,       // the PACS has them all
  kReported,   // and the server knows
  kFailed,     // cannot be done, which the server knows
};
const char* BridgeExportStateName(BridgeExportState state);

struct QueuedExport {
  std::string name = {};  // "exports/{id}" of the server
  std::string key = {};   // random: names its folder
  std::string prediction = {};
  std::string case_name = {};
  BridgeExportState state = BridgeExportState::kAsked;
  std::string note = {};       // what a person is to know before confirming; nothing of a patient
  std::string confirmed = {};  // DigestOf the patient that was shown to who confirmed
  int64_t attempts = 0;        // of the step that is next
  std::string last_error = {};
  int64_t first_s = 0;  // when a person was asked, the last time; unix seconds
  int64_t done_s = 0;   // when the server knew how it ended; 0: it does not
};

// One object that an export writes. Its UID is here before its first byte is.
struct QueuedObject {
  std::string key = {};  // "stl:skin"; "series:stl" for a series' UID, which is never sent itself
  std::string uid = {};
  std::string file = {};  // empty: not written yet
  bool sent = false;
};

// From a row with all columns of exports. Errors: DataLoss: an unknown state.
absl::StatusOr<QueuedExport> ExportOf(const Database::Query& row);

}  // namespace tissueform
