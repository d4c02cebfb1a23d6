// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/rpc/calls/message_stream.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// A file that is sent in messages with offset, data and total_bytes.
struct FileInParts {
  std::shared_ptr<OpenFile> file;
  int64_t offset = 0;
  int64_t total = 0;
  bool has_sent = false;  // an empty file is one empty chunk
};

template <typename Message>
absl::StatusOr<bool> NextPart(int64_t max_chunk_bytes, FileInParts* parts, Message* message) {
  if (parts->has_sent && parts->offset >= parts->total) return false;
  TF_ASSIGN_OR_RETURN(
      *message->mutable_data(),
      parts->file->ReadAt(parts->offset, std::min(max_chunk_bytes, parts->total - parts->offset)));
  message->set_offset(parts->offset);
  message->set_total_bytes(parts->total);
  parts->offset += static_cast<int64_t>(message->data().size());
  parts->has_sent = true;
  return true;
}

// Sends what `open` opens; both where the disk may be waited for.
template <typename Message>
void SendFile(MessageStream<Message>* call, WorkerPool* pool, int64_t max_chunk_bytes,
              std::function<absl::StatusOr<OpenFile>()> open) {
  const auto post = [pool](WorkerPool::Job job) { pool->Post(Lane::kStore, std::move(job)); };
  post([call, post, max_chunk_bytes, open = std::move(open)] {
    absl::StatusOr<OpenFile> file = open();
    const absl::StatusOr<int64_t> total = file.ok() ? file->Size() : file.status();
    if (!total.ok()) {
      call->End(total.status());
      return;
    }
    FileInParts parts{.file = std::make_shared<OpenFile>(*std::move(file)), .total = *total};
    call->Send([parts = std::move(parts), max_chunk_bytes](
                   Message* message) mutable { return NextPart(max_chunk_bytes, &parts, message); },
               post);
  });
}

}  // namespace tissueform
