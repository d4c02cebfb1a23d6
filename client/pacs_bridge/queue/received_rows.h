// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/dicom/instance_header.h"
#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {

// Whose a study is, as the images say it: UTF-8, cut to kMostIdentityBytes each.
inline constexpr size_t kMostIdentityBytes = 1024;
struct PatientIdentity {
  std::string id = {};
  std::string issuer = {};
  std::string name = {};
  std::string birth_date = {};
  // False: a text could not be read as it was meant (an unknown character set, too long).
  bool readable = true;

  friend bool operator==(const PatientIdentity&, const PatientIdentity&) = default;
};
// What an image says of its patient.
PatientIdentity IdentityOf(const InstanceHeader& image);
// A digest of it, by which a later look sees that something has changed.
std::string DigestOf(const PatientIdentity& patient);

struct QueuedStudy {
  std::string uid = {};
  PatientIdentity patient = {};
  std::string date = {};
  std::string description = {};
};

// How far a series has come; one step after the other, each of which may be repeated.
enum class SeriesState {
  kReceiving,
  kIncomplete,  // it stopped midway: nothing is made of it unless more comes
  kComplete,
  kPassedOver,  // another one was chosen, or no rule takes it: `reason`
  kChosen,
  kBuilt,   // its plan folder is there
  kPacked,  // the case lies in the plan folder, and its name is known
  kPublished,
  kFailed,
};
const char* SeriesStateName(SeriesState state);

struct QueuedSeries {
  std::string key = {};  // random, 32 hexadecimal digits: names folders, logs and status
  std::string study_uid = {};
  std::string uid = {};
  std::string frame_uid = {};
  std::string modality = {};
  SeriesState state = SeriesState::kReceiving;
  std::string reason = {};     // why chosen, passed over or failed; nothing of a patient
  std::string recipe = {};     // file, of a chosen one
  std::string case_name = {};  // "cases/{sha256}" when it is packed
  int64_t attempts = 0;        // of the step that is next
  std::string last_error = {};
  int64_t first_s = 0;  // wall clock, to be told and for retention
  int64_t done_s = 0;   // published, passed over or failed
  bool has_files = true;
  bool has_header = false;
  int64_t images = 0;  // filled by reading; writing passes over it
};

struct QueuedImage {
  std::string series = {};  // key
  std::string uid = {};
  std::string class_uid = {};
  std::string file = {};
};

// What was received. Copies nothing of its queue, which must outlive it. Thread-safe.
class ReceivedRows {
 public:
  explicit ReceivedRows(BridgeQueue* queue) : queue_(queue) {}

  // Puts images of one series there, and the series and its study where they are new: then `series`
  // gets `new_key` as its key. An image that is there stays. The state goes back to kReceiving
  // where the series was incomplete. Returns the series as it is now.
  //
  // Errors: FailedPrecondition: the series is known as one of another study.
  absl::StatusOr<QueuedSeries> Add(const QueuedStudy& study, const QueuedSeries& series,
                                   const std::string& new_key,
                                   const std::vector<QueuedImage>& images);

  // Writes all of the series but its key and UIDs. Errors: NotFound.
  absl::Status Update(const QueuedSeries& series);
  absl::Status UpdatePatient(const std::string& study_uid, const PatientIdentity& patient);

  absl::StatusOr<QueuedSeries> Get(const std::string& key);  // NotFound
  absl::StatusOr<QueuedSeries> GetByUid(const std::string& uid);
  // Of which series a case was made; NotFound: none of this bridge.
  absl::StatusOr<QueuedSeries> GetByCase(const std::string& case_name);
  absl::StatusOr<std::vector<QueuedSeries>> List();
  absl::StatusOr<std::vector<QueuedSeries>> ListStudy(const std::string& study_uid);
  absl::StatusOr<QueuedStudy> GetStudy(const std::string& uid);
  absl::StatusOr<std::vector<QueuedImage>> ListImages(const std::string& series);
  // Takes the images' files out of the queue before they are deleted; the images stay known.
  absl::Status ForgetFiles(const std::string& series);

 private:
  absl::StatusOr<std::vector<QueuedSeries>> Select(const char* sql, const std::string& value);
  absl::StatusOr<QueuedSeries> SelectOne(const char* sql, const std::string& value);

  BridgeQueue* const queue_;
};

}  // namespace tissueform
