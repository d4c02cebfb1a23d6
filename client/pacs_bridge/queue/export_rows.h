// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {

// How far an export has come; one step after the other, each of which may be repeated.
enum class BridgeExportState {
  kAsked,      // its patient is shown in the work list
  kConfirmed,  // by a person
  kFetched,    // the patient's header is there, and says what the person has seen
  kWritten,    // all objects lie in its folder
  kSent,       // the PACS has them all
  kTold,       // and the server knows
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
  int64_t first_s = 0;
  int64_t done_s = 0;
};

// One object that an export writes. Its UID is here before its first byte is.
struct QueuedObject {
  std::string key = {};  // "stl:skin"; "series:stl" for a series' UID, which is never sent itself
  std::string uid = {};
  std::string file = {};  // empty: not written yet
  bool sent = false;
};

// What goes back to the PACS. Copies nothing of its queue, which must outlive it. Thread-safe.
class ExportRows {
 public:
  explicit ExportRows(BridgeQueue* queue) : queue_(queue) {}

  // Puts it there unless one of its name is; returns the one that is there.
  absl::StatusOr<QueuedExport> Add(const QueuedExport& asked);
  // Writes all but name, key, prediction and case. Errors: NotFound.
  absl::Status Update(const QueuedExport& changed);
  // A person says that the patient with this digest is the right one. Errors: NotFound;
  // FailedPrecondition: it does not wait for that.
  absl::Status Confirm(const std::string& name, const std::string& digest);

  absl::StatusOr<QueuedExport> Get(const std::string& name);  // NotFound
  absl::StatusOr<std::vector<QueuedExport>> List();

  // Puts UIDs there for keys that have none; `make_uid` is asked for each. Returns all, by key.
  absl::StatusOr<std::vector<QueuedObject>> EnsureObjects(const std::string& name,
                                                          const std::vector<std::string>& keys,
                                                          std::string (*make_uid)());
  absl::StatusOr<std::vector<QueuedObject>> ListObjects(const std::string& name);
  absl::Status UpdateObject(const std::string& name, const QueuedObject& object);

 private:
  BridgeQueue* const queue_;
};

}  // namespace tissueform
