// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "client/pacs_bridge/queue/patient_identity.h"
#include "client/pacs_bridge/queue/queued_export.h"

namespace tissueform {

// What goes back to the PACS. Copies nothing of its queue, which must outlive it. Thread-safe.
class ExportRows {
 public:
  explicit ExportRows(BridgeQueue* queue) : queue_(queue) {}

  // Puts it there unless one of its name is; returns the one that is there.
  absl::StatusOr<QueuedExport> Add(const QueuedExport& asked);
  // Writes all but name, key, prediction and case. Errors: NotFound.
  absl::Status Update(const QueuedExport& changed);
  // Writes it as Update does, and with it who the patient of its study is now, both or neither.
  absl::Status UpdateWithPatient(const QueuedExport& changed, const std::string& study_uid,
                                 const PatientIdentity& patient);
  // A person says that the patient with this digest is the right one. Errors: NotFound;
  // FailedPrecondition: it does not wait for that.
  absl::Status Confirm(const std::string& name, const std::string& digest);

  // Those that have waited for a person since before `before_s` become kFailed, with this note; the
  // server does not know that yet. Returns how many.
  absl::StatusOr<int> FailAsked(int64_t before_s, const std::string& note);
  // All that is known of it, its objects' UIDs too. Nothing happens where it is not there.
  absl::Status Remove(const std::string& name);

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
