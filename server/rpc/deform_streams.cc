// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_streams.h"

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "server/rpc/deform_stream.h"

namespace tissueform {

absl::Status DeformStreams::Add(DeformStreamReactor* stream) {
  MutexLock lock(mutex_);
  if (streams_.size() >= static_cast<size_t>(max_streams_)) {
    return WithReason(absl::ResourceExhaustedError(absl::StrCat(
                          "the server has ", max_streams_,
                          " open streams, which is the limit; close one or raise --max-streams")),
                      ErrorReason::kTooManyStreams, {{"limit", absl::StrCat(max_streams_)}});
  }
  streams_.insert(stream);
  return absl::OkStatus();
}

void DeformStreams::Remove(DeformStreamReactor* stream) {
  MutexLock lock(mutex_);
  streams_.erase(stream);
}

void DeformStreams::NotifyDraining(std::chrono::system_clock::time_point end) {
  MutexLock lock(mutex_);
  for (DeformStreamReactor* stream : streams_) {
    stream->NotifyDraining(end);
  }
}

void DeformStreams::OnSessionEvent(const std::string& session_id, SessionEvent event) {
  if (event != SessionEvent::kMoved) return;
  MutexLock lock(mutex_);
  for (DeformStreamReactor* stream : streams_) stream->EndIfMoved(session_id);
}

std::map<std::string, int64_t> DeformStreams::CountByPrincipal() const {
  std::map<std::string, int64_t> counts;
  MutexLock lock(mutex_);
  for (const DeformStreamReactor* stream : streams_) ++counts[stream->principal()];
  return counts;
}

int DeformStreams::size() const {
  MutexLock lock(mutex_);
  return static_cast<int>(streams_.size());
}

}  // namespace tissueform
