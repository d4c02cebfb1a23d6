// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/incoming_instances.h"

#include <ios>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {

IncomingInstances::IncomingInstances(const std::string& peer_name, const InstanceFolder& folder,
                                     InstanceSink* sink)
    : folder_(folder), sink_(sink) {
  announced_.calling_ae = peer_name;
}

absl::Status IncomingInstances::Take(const std::string& content_type, absl::string_view piece) {
  if (!splitter_) {
    MultipartSplitter::Events events;
    events.begin = [this] { return Begin(); };
    events.data = [this](absl::string_view bytes) { return Write(bytes); };
    events.end = [this] { return End(); };
    auto made = MultipartSplitter::Create(content_type, std::move(events));
    if (!made.ok()) return made.status();
    splitter_.emplace(*std::move(made));
  }
  return splitter_->Take(piece);
}

absl::StatusOr<FetchCounts> IncomingInstances::Finish() const {
  if (splitter_) TF_RETURN_IF_ERROR(splitter_->Finish());
  if (counts_.completed == 0 && !first_problem_.ok()) return first_problem_;
  return counts_;
}

absl::Status IncomingInstances::Begin() {
  TF_RETURN_IF_ERROR(folder_.CheckRoom());
  TF_ASSIGN_OR_RETURN(PartialFile partial, folder_.NewPartial());
  partial_.emplace(std::move(partial));
  file_ = std::ofstream(partial_->path(), std::ios::binary | std::ios::trunc);
  bytes_ = 0;
  return absl::OkStatus();
}

absl::Status IncomingInstances::Write(absl::string_view bytes) {
  bytes_ += static_cast<int64_t>(bytes.size());
  if (bytes_ > folder_.options().limits.max_file_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "an object has more than ", folder_.options().limits.max_file_bytes, " bytes"));
  }
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return absl::OkStatus();
}

absl::Status IncomingInstances::End() {
  file_.close();
  if (file_.fail()) {
    return absl::ResourceExhaustedError("an object cannot be written: is the disk full?");
  }
  PartialFile whole = *std::move(partial_);
  partial_.reset();
  const absl::Status kept = folder_.Take(std::move(whole), announced_, sink_).status();
  if (!kept.ok() && first_problem_.ok()) first_problem_ = kept;
  ++(kept.ok() ? counts_.completed : counts_.failed);
  return absl::OkStatus();
}

}  // namespace tissueform
