// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/reattaching_stream.h"

#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<ReattachingStream>> ReattachingStream::Open(
    TissueformClient* client, const std::string& session, Options options) {
  std::unique_ptr<ReattachingStream> drag(
      new ReattachingStream(client, session, std::move(options)));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<DeformStream> stream, drag->OpenStream(kFailoverPatience));
  drag->started_ = stream->started();
  drag->Adopt(std::move(stream));
  return drag;
}

absl::StatusOr<std::unique_ptr<DeformStream>> ReattachingStream::OpenStream(
    std::chrono::milliseconds patience) {
  DeformStream::Options options = options_.stream;
  options.on_notice = [this](const v1::DeformNotice& notice) { TakeNotice(notice); };
  return client_->OpenStream(session_, options, patience);
}

void ReattachingStream::TakeNotice(const v1::DeformNotice& notice) {
  if (options_.stream.on_notice) options_.stream.on_notice(notice);
  if (!notice.has_committed() || !notice.committed().failure().empty()) return;
  MutexLock lock(mutex_);
  last_committed_ = notice.committed().sequence();
  if (uncommitted_.has_value() && uncommitted_->sequence <= *last_committed_) uncommitted_.reset();
}

void ReattachingStream::SendPoses(uint64_t sequence, absl::Span<const NamedPose> poses,
                                  bool commit) {
  MutexLock lock(mutex_);
  newest_ = {sequence, {poses.begin(), poses.end()}, commit};
  if (commit) uncommitted_ = newest_;
  // Whether it arrives is seen where frames are received.
  if (stream_ != nullptr) stream_->SendPoses(sequence, poses, commit).IgnoreError();
}

void ReattachingStream::Ack(const v1::DeformFrame& frame) {
  MutexLock lock(mutex_);
  if (stream_ != nullptr) stream_->Ack(frame).IgnoreError();
}

void ReattachingStream::CloseSending() {
  MutexLock lock(mutex_);
  closed_ = true;
  if (stream_ != nullptr) stream_->CloseSending();
}

void ReattachingStream::Cancel() {
  reattachment_.Cancel();
  MutexLock lock(mutex_);
  if (stream_ != nullptr) stream_->Cancel();
}

std::optional<v1::DeformFrame> ReattachingStream::Receive() {
  while (true) {
    std::shared_ptr<DeformStream> stream;
    {
      MutexLock lock(mutex_);
      stream = stream_;
    }
    if (stream == nullptr) return std::nullopt;
    if (std::optional<v1::DeformFrame> frame = stream->Receive(); frame.has_value()) return frame;
    {
      MutexLock lock(mutex_);
      stream_.reset();
    }
    end_ = stream->Finish();
    if (end_.ok()) return std::nullopt;
    end_ = reattachment_.After(end_, [this] {
      absl::StatusOr<std::unique_ptr<DeformStream>> next = OpenStream(kNoPatience);
      if (!next.ok()) return next.status();
      Adopt(*std::move(next));
      return absl::OkStatus();
    });
    if (!end_.ok()) return std::nullopt;
  }
}

void ReattachingStream::Adopt(std::unique_ptr<DeformStream> stream) {
  MutexLock lock(mutex_);
  stream_ = std::move(stream);
  node_ = stream_->node();
  // In their order; the last one sent is the newest.
  if (uncommitted_.has_value() && uncommitted_->sequence < newest_->sequence) {
    stream_->SendPoses(uncommitted_->sequence, uncommitted_->poses, true).IgnoreError();
  }
  if (newest_.has_value()) {
    const bool commit = uncommitted_.has_value() && uncommitted_->sequence == newest_->sequence;
    stream_->SendPoses(newest_->sequence, newest_->poses, commit).IgnoreError();
  }
  if (closed_) stream_->CloseSending();
  if (reattachment_.cancelled()) stream_->Cancel();
}

absl::Status ReattachingStream::Finish() {
  MutexLock lock(mutex_);
  stream_.reset();
  return end_;
}

std::optional<uint64_t> ReattachingStream::last_committed() const {
  MutexLock lock(mutex_);
  return last_committed_;
}

std::string ReattachingStream::node() const {
  MutexLock lock(mutex_);
  return node_;
}

}  // namespace tissueform
