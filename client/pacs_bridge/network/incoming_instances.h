// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/dicom/partial_file.h"
#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "client/pacs_bridge/network/multipart_splitter.h"
#include "client/pacs_bridge/network/pacs_client.h"

namespace tissueform {

// The objects of a WADO-RS answer: each goes into the folder and to the sink when it has come
// whole. What one of them lacks does not stop the others; a full disk does.
//
// Folder and sink outlive it. One thread.
class IncomingInstances {
 public:
  IncomingInstances(const std::string& peer_name, const InstanceFolder& folder, InstanceSink* sink);

  // The next piece of the body. Errors: those of MultipartSplitter, ResourceExhausted.
  absl::Status Take(const std::string& content_type, absl::string_view piece);
  // The body is over. Errors: the first object's where none was kept.
  absl::StatusOr<FetchCounts> Finish() const;

 private:
  absl::Status Begin();
  absl::Status Write(absl::string_view bytes);
  absl::Status End();

  const InstanceFolder& folder_;
  InstanceSink* const sink_;
  AnnouncedInstance announced_;
  std::optional<MultipartSplitter> splitter_;
  std::optional<PartialFile> partial_;  // of the object that comes
  std::ofstream file_;
  int64_t bytes_ = 0;
  FetchCounts counts_;
  absl::Status first_problem_;
};

}  // namespace tissueform
