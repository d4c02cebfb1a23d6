// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "client/cpp/reattachment.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/mutex.h"

namespace tissueform {

// A drag that outlives its connection, a server that is started again on what it has kept, and the
// server of a cluster that held its session: where the stream breaks it opens another one of the
// same session and sends the newest pose once more, and before it the one that was to be committed
// and was not (sequences must rise). What the server has said to be committed is not sent again.
//
// One thread may receive while another sends. It reattaches within Receive: without a thread that
// receives nothing comes back. The client must outlive it.
class ReattachingStream {
 public:
  struct Options {
    DeformStream::Options stream = {};
    Reattachment::Options reattachment = {};  // functions are called on the receiving thread
  };

  // Errors: those of TissueformClient::OpenStream; the first stream is opened once.
  static absl::StatusOr<std::unique_ptr<ReattachingStream>> Open(TissueformClient* client,
                                                                 const std::string& session,
                                                                 Options options);

  // What the server said when the stream began, the first time.
  const v1::DeformStarted& started() const { return started_; }

  // As of DeformStream; while there is no stream the newest poses wait for the next one.
  void SendPoses(uint64_t sequence, absl::Span<const NamedPose> poses, bool commit = false);
  void Ack(const v1::DeformFrame& frame);
  void CloseSending();

  // Blocks until the next frame. Empty when the drag has ended; Finish says how.
  std::optional<v1::DeformFrame> Receive();

  // Ends the drag at once. Any thread, any time.
  void Cancel();

  // How the drag ended. Call it once, when Receive has returned nothing.
  absl::Status Finish();

  // Of the poses that are committed the last one; empty: none.
  std::optional<uint64_t> last_committed() const;
  int reattachments() const { return reattachment_.count(); }
  // The server of a cluster that answers now, or did last.
  std::string node() const;

 private:
  struct SentPose {
    uint64_t sequence = 0;
    std::vector<NamedPose> poses;
    bool commit = false;
  };

  ReattachingStream(TissueformClient* client, std::string session, Options options)
      : client_(client),
        session_(std::move(session)),
        options_(std::move(options)),
        reattachment_(options_.reattachment) {}

  absl::StatusOr<std::unique_ptr<DeformStream>> OpenStream(std::chrono::milliseconds patience);
  // Called while frames are received.
  void TakeNotice(const v1::DeformNotice& notice) ABSL_LOCKS_EXCLUDED(mutex_);
  void Adopt(std::unique_ptr<DeformStream> stream) ABSL_LOCKS_EXCLUDED(mutex_);

  // Constant.
  TissueformClient* const client_;
  const std::string session_;
  const Options options_;
  v1::DeformStarted started_;

  // Self-synchronised.
  Reattachment reattachment_;

  // Held while sending: sequences must rise.
  mutable Mutex mutex_;
  // Replaced by the receiving thread alone, which reads from it without the lock.
  std::shared_ptr<DeformStream> stream_ ABSL_GUARDED_BY(mutex_);
  std::string node_ ABSL_GUARDED_BY(mutex_);
  std::optional<SentPose> newest_ ABSL_GUARDED_BY(mutex_);
  std::optional<SentPose> uncommitted_ ABSL_GUARDED_BY(mutex_);  // the newest that waits for it
  std::optional<uint64_t> last_committed_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status end_;  // the receiving thread's
};

}  // namespace tissueform
