// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/backoff.h"
#include "core/base/certificates.h"
#include "core/base/mutex.h"
#include "server/platform/audit/audit_buffer.h"
#include "server/platform/audit/audit_sink.h"
#include "server/platform/audit/syslog_frame.h"
#include "server/platform/http/tls_stream.h"

namespace tissueform {

// A collector that is sent RFC 5424 messages over TLS (RFC 5425). A message is taken when it is in
// the buffer on the disk; a thread sends what the buffer has, in order, also after a restart.
//
// At least once: a message leaves the buffer when the collector's kernel has acknowledged it and
// the connection was still open a while later (`settle_time`), so a broken connection can bring
// duplicates, by the same sequenceId. RFC 5425 has no acknowledgement of its own: what a collector
// has not read for longer than that and loses with its own process is lost.
class CollectorSink final : public AuditSink {
 public:
  struct Options {
    std::string host;
    int port = 6514;
    TlsFiles tls = {};
    std::string buffer_file;
    int64_t max_buffer_bytes = int64_t{256} << 20;
    std::chrono::milliseconds settle_time{1000};
    std::chrono::milliseconds patience{
        10'000};                                // a collector that reads nothing for longer is left
    std::chrono::milliseconds last_time{2000};  // for what waits when the program ends
    Backoff::Options backoff = {.first = std::chrono::milliseconds(100),
                                .most = std::chrono::seconds(10)};
  };

  // Does not wait for the collector. Errors: those of AuditBuffer::Open and CheckTlsContents.
  static absl::StatusOr<std::unique_ptr<CollectorSink>> Open(const AuditProgram& program,
                                                             Options options);
  // What could not be sent stays in the buffer.
  ~CollectorSink() override;
  CollectorSink(const CollectorSink&) = delete;
  CollectorSink& operator=(const CollectorSink&) = delete;

  absl::Status Take(std::deque<std::string>* messages) override;
  double BufferUse() const override { return buffer_->Use(); }

 private:
  using Clock = std::chrono::steady_clock;

  CollectorSink(const AuditProgram& program, Options options, std::unique_ptr<AuditBuffer> buffer);

  void Work();
  // Sends what the buffer has and removes what has settled.
  absl::Status Deliver();
  absl::Status Send(const std::vector<AuditBuffer::Message>& messages);
  absl::Status RemoveSettled(Clock::time_point now);
  void Disconnect();
  // One line in the log when it begins to fail, one when it works again.
  void LogChange(const absl::Status& status);
  // Until there are new messages, what was sent has settled, or the end.
  void WaitForWork() ABSL_LOCKS_EXCLUDED(mutex_);
  void WaitToRetry(std::chrono::milliseconds time) ABSL_LOCKS_EXCLUDED(mutex_);
  bool IsEnding() const ABSL_LOCKS_EXCLUDED(mutex_);

  const Options options_;
  const SyslogFormat format_;
  const std::unique_ptr<AuditBuffer> buffer_;

  // The thread's.
  std::unique_ptr<TlsStream> stream_;  // null: not connected
  int64_t sent_ = 0;                   // number of the last message of this connection
  int64_t removed_ = 0;                // number of the last message that was removed
  int64_t settling_ = 0;               // these are removed at settled_at_; 0: none
  Clock::time_point settled_at_ = {};
  bool is_failing_ = false;  // the log says so

  std::atomic<bool> stopping_ = false;  // ends what blocks
  mutable Mutex mutex_;
  ConditionVariable changed_;
  bool has_new_ ABSL_GUARDED_BY(mutex_) = false;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  bool done_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
