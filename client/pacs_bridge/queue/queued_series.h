// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/patient_identity.h"
#include "server/platform/storage/database.h"

namespace tissueform {

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
  kDrafting,  // chosen, to wait on the server for its operator
  kDraft,     // waits there (DraftRows); published when a case was built of it
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
  std::string case_name = {};  // "cases/{sha256}" when it is packed: the last one
  int64_t attempts = 0;        // of the step that is next
  std::string last_error = {};
  int64_t first_s = 0;  // wall clock, for reports and retention
  int64_t done_s = 0;   // since when nothing is done with it; 0: it is being worked on
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

// The images for a plan: those of CT classes, or all if there are no such images. Other objects of
// a series (captures, reports) are not a source of a plan and may be without a frame of reference.
std::vector<QueuedImage> SourcesAmong(const std::vector<QueuedImage>& images);

// From a row with the columns that ReceivedRows selects. Errors: DataLoss: an unknown state.
absl::StatusOr<QueuedSeries> SeriesOf(const Database::Query& row);

}  // namespace tissueform
