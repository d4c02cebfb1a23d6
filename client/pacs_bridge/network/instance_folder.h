// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/partial_file.h"
#include "client/pacs_bridge/network/instance_sink.h"

namespace tissueform {

struct InstanceFolderOptions {
  std::string path = {};  // exists, on one file system, used by this process only
  // Nothing is taken that would leave less than this free on the disk.
  int64_t watermark_bytes = int64_t{2} << 30;
  DicomLimits limits = {};  // of one object
};

// What is said of an object before its bytes come. UIDs: empty where nothing was said.
struct AnnouncedInstance {
  std::string class_uid = {};
  std::string instance_uid = {};
  std::string transfer_syntax_uid = {};
  std::string calling_ae = {};
  std::string address = {};
  int64_t association = 0;
};

// The folder that received objects lie in. A file is called by the SHA-256 of its object's UID, so
// that what comes again is known without an index, also after a crash; it is readable by its owner
// alone, and appears when it is whole and synced.
//
// Threads: any, many at once. Two writers of one object: the last file counts.
class InstanceFolder {
 public:
  // Removes what a crash has left half-written. Errors: NotFound, FailedPrecondition.
  static absl::StatusOr<std::unique_ptr<InstanceFolder>> Open(const InstanceFolderOptions& options);

  // OK while the disk has room. Errors: ResourceExhausted, with the folder.
  absl::Status CheckRoom(int64_t bytes = 0) const;

  const InstanceFolderOptions& options() const { return options_; }

  // For an object that begins to come: a file beside the others, empty.
  absl::StatusOr<PartialFile> NewPartial() const;

  // Takes a whole file (PS3.10) into the folder and shows it to the sink.
  //
  // Errors: InvalidArgument (not readable as DICOM, or not what was announced, where UIDs were),
  // those of the disk and of the sink.
  absl::StatusOr<ReceivedInstance> Take(PartialFile partial, const AnnouncedInstance& announced,
                                        InstanceSink* sink) const;

 private:
  explicit InstanceFolder(InstanceFolderOptions options) : options_(std::move(options)) {}

  std::string NameOf(absl::string_view instance_uid) const;

  const InstanceFolderOptions options_;
};

}  // namespace tissueform
