// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/collector_sink.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kMaxMessagesPerWrite = 256;

}  // namespace

absl::StatusOr<std::unique_ptr<CollectorSink>> CollectorSink::Open(const AuditProgram& program,
                                                                   Options options) {
  TF_ASSIGN_OR_RETURN(const TlsContents contents, ReadTlsFiles(options.tls));
  TF_RETURN_IF_ERROR(CheckTlsContents(options.tls, contents).status());
  TF_ASSIGN_OR_RETURN(std::unique_ptr<AuditBuffer> buffer,
                      AuditBuffer::Open(options.buffer_file, options.max_buffer_bytes));
  return std::unique_ptr<CollectorSink>(
      new CollectorSink(program, std::move(options), std::move(buffer)));
}

CollectorSink::CollectorSink(const AuditProgram& program, Options options,
                             std::unique_ptr<AuditBuffer> buffer)
    : options_(std::move(options)),
      format_(program),
      buffer_(std::move(buffer)),
      thread_([this] { Work(); }) {}

CollectorSink::~CollectorSink() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
    const Clock::time_point end = Clock::now() + options_.last_time;
    while (!done_ && changed_.WaitUntil(mutex_, end)) {
    }
  }
  stopping_ = true;
  thread_.join();
}

absl::Status CollectorSink::Take(std::deque<std::string>* messages) {
  const absl::Status status = buffer_->Append(messages);
  MutexLock lock(mutex_);
  has_new_ = true;
  changed_.NotifyAll();
  return status;
}

void CollectorSink::Work() {
  Backoff backoff(options_.backoff);
  for (bool is_last = false; !is_last;) {
    is_last = IsEnding();
    const absl::Status status = Deliver();
    LogChange(status);
    if (!status.ok()) Disconnect();
    if (is_last) break;
    if (status.ok()) {
      backoff.Reset();
      WaitForWork();
    } else {
      WaitToRetry(backoff.Next());
    }
  }
  // An orderly end: the collector closes nothing before it has read what its kernel acknowledged.
  if (sent_ > removed_) buffer_->Remove(sent_).IgnoreError();
  MutexLock lock(mutex_);
  done_ = true;
  changed_.NotifyAll();
}

absl::Status CollectorSink::Deliver() {
  if (stream_ != nullptr && !stream_->IsOpen()) {
    return absl::UnavailableError("the collector has closed the connection");
  }
  while (true) {
    TF_ASSIGN_OR_RETURN(const std::vector<AuditBuffer::Message> messages,
                        buffer_->Read(sent_, kMaxMessagesPerWrite));
    if (!messages.empty()) TF_RETURN_IF_ERROR(Send(messages));
    TF_RETURN_IF_ERROR(RemoveSettled(Clock::now()));
    if (messages.empty()) return absl::OkStatus();
  }
}

absl::Status CollectorSink::Send(const std::vector<AuditBuffer::Message>& messages) {
  if (stream_ == nullptr) {
    TF_ASSIGN_OR_RETURN(stream_, TlsStream::Connect({.host = options_.host,
                                                     .port = options_.port,
                                                     .files = options_.tls,
                                                     .stopping = &stopping_}));
  }
  std::string frames;
  for (const AuditBuffer::Message& message : messages) {
    frames += format_.Frame(message.number, message.time, message.text);
  }
  TF_RETURN_IF_ERROR(stream_->Send(frames, options_.patience));
  sent_ = messages.back().number;
  return absl::OkStatus();
}

absl::Status CollectorSink::RemoveSettled(Clock::time_point now) {
  if (settling_ > 0 && now >= settled_at_) {
    if (!stream_->IsOpen()) {
      return absl::UnavailableError("the collector has closed the connection");
    }
    TF_RETURN_IF_ERROR(buffer_->Remove(settling_));
    removed_ = std::exchange(settling_, 0);
  }
  if (settling_ == 0 && sent_ > removed_) {
    settling_ = sent_;
    settled_at_ = now + options_.settle_time;
  }
  return absl::OkStatus();
}

void CollectorSink::Disconnect() {
  stream_.reset();
  sent_ = 0;
  settling_ = 0;
}

void CollectorSink::LogChange(const absl::Status& status) {
  if (status.ok() == !is_failing_) return;
  is_failing_ = !status.ok();
  if (is_failing_) {
    spdlog::warn("audit collector {}:{}: {}; events wait in {}", options_.host, options_.port,
                 std::string(status.message()), options_.buffer_file);
  } else {
    spdlog::info("audit collector {}:{}: takes events again", options_.host, options_.port);
  }
}

void CollectorSink::WaitForWork() {
  MutexLock lock(mutex_);
  while (!has_new_ && !ending_) {
    if (settling_ == 0) {
      changed_.Wait(mutex_);
    } else if (!changed_.WaitUntil(mutex_, settled_at_)) {
      break;
    }
  }
  has_new_ = false;
}

void CollectorSink::WaitToRetry(std::chrono::milliseconds time) {
  const Clock::time_point next = Clock::now() + time;
  MutexLock lock(mutex_);
  while (!ending_ && changed_.WaitUntil(mutex_, next)) {
  }
}

bool CollectorSink::IsEnding() const {
  MutexLock lock(mutex_);
  return ending_;
}

}  // namespace tissueform
