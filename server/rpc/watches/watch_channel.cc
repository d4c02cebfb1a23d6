// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/watches/watch_channel.h"

#include <utility>

#include "google/protobuf/util/time_util.h"
#include "grpcpp/support/slice.h"

namespace tissueform {
namespace {

google::protobuf::Timestamp ToTimestamp(std::chrono::system_clock::time_point time) {
  return google::protobuf::util::TimeUtil::NanosecondsToTimestamp(
      std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count());
}

}  // namespace

SharedBytes ToBytes(const v1::WatchResponse& message) {
  const grpc::Slice slice(message.ByteSizeLong());
  // The slice is its own until it is shared: gRPC's own serialisation writes so, too.
  message.SerializeWithCachedSizesToArray(const_cast<uint8_t*>(slice.begin()));
  return std::make_shared<const grpc::ByteBuffer>(&slice, 1);
}

void WatchChannel::Publish(std::shared_ptr<const v1::DeformResponse> response,
                           std::shared_ptr<const v1::WatchForm> form) {
  MutexLock lock(newest_mutex_);
  Put({.origin = v1::WATCH_ORIGIN_DRAG,
       .time = std::chrono::system_clock::now(),
       .response = std::move(response),
       .form = std::move(form)});
}

void WatchChannel::PublishBase(v1::WatchOrigin origin, v1::DeformFrame frame,
                               std::shared_ptr<const v1::WatchForm> form) {
  auto response = std::make_shared<v1::DeformResponse>();
  *response->mutable_frame() = std::move(frame);
  MutexLock lock(newest_mutex_);
  if (newest_.response != nullptr) return;
  Put({.origin = origin,
       .time = std::chrono::system_clock::now(),
       .response = std::move(response),
       .form = std::move(form)});
}

void WatchChannel::Put(Newest newest) {
  newest_ = std::move(newest);
  to_encode_ = true;
  if (watched_) StartEncoding();
}

void WatchChannel::StartEncoding() {
  if (std::exchange(encoding_, true)) return;
  pool_->Post(Lane::kFrames, [self = shared_from_this()] { self->EncodeAll(); });
}

std::optional<WatchChannel::Newest> WatchChannel::TakeToEncode() {
  MutexLock lock(newest_mutex_);
  if (!to_encode_ || !watched_) {
    encoding_ = false;
    return std::nullopt;
  }
  to_encode_ = false;
  return newest_;
}

void WatchChannel::EncodeAll() {
  while (const std::optional<Newest> newest = TakeToEncode()) {
    v1::WatchResponse message;
    v1::WatchFrame* proto = message.mutable_frame();
    proto->set_number(++last_number_);
    proto->set_origin(newest->origin);
    *proto->mutable_time() = ToTimestamp(newest->time);
    *proto->mutable_frame() = newest->response->frame();
    auto frame = std::make_shared<const WatchedFrame>(
        WatchedFrame{proto->number(), newest->form, ToBytes(message)});
    MutexLock lock(watchers_mutex_);
    for (Watcher* watcher : watchers_) watcher->Show(frame);
    if (!watchers_.empty()) shown_ = std::move(frame);
  }
}

void WatchChannel::AddDrag(Dragger* dragger) {
  MutexLock lock(watchers_mutex_);
  drags_.insert(dragger);
  if (!watchers_.empty()) dragger->FollowersChanged(static_cast<int>(watchers_.size()));
}

void WatchChannel::RemoveDrag(Dragger* dragger) {
  MutexLock lock(watchers_mutex_);
  drags_.erase(dragger);
  if (!drags_.empty() || !end_with_drags_.has_value()) return;
  for (Watcher* watcher : watchers_) watcher->EndWatch(*end_with_drags_);
}

void WatchChannel::NotifyDrags() {
  for (Dragger* dragger : drags_) dragger->FollowersChanged(static_cast<int>(watchers_.size()));
}

bool WatchChannel::Add(Watcher* watcher) {
  MutexLock lock(watchers_mutex_);
  watchers_.insert(watcher);
  NotifyDrags();
  if (end_with_drags_.has_value() && drags_.empty()) watcher->EndWatch(*end_with_drags_);
  if (shown_ != nullptr) watcher->Show(shown_);
  MutexLock newest_lock(newest_mutex_);
  watched_ = true;
  if (to_encode_) StartEncoding();
  return newest_.response != nullptr;
}

void WatchChannel::Remove(Watcher* watcher) {
  MutexLock lock(watchers_mutex_);
  watchers_.erase(watcher);
  NotifyDrags();
  if (!watchers_.empty()) return;
  // Kept without encoding until there is a watcher again.
  shown_.reset();
  MutexLock newest_lock(newest_mutex_);
  watched_ = false;
  to_encode_ = newest_.response != nullptr;
}

size_t WatchChannel::num_watchers() const {
  MutexLock lock(watchers_mutex_);
  return watchers_.size();
}

void WatchChannel::Notify(const v1::DeformNotice& notice) {
  MutexLock lock(watchers_mutex_);
  for (Watcher* watcher : watchers_) watcher->Notify(notice);
}

void WatchChannel::EndWatches(const absl::Status& outcome) {
  MutexLock lock(watchers_mutex_);
  for (Watcher* watcher : watchers_) watcher->EndWatch(outcome);
}

void WatchChannel::EndWithDrags(const absl::Status& outcome) {
  MutexLock lock(watchers_mutex_);
  end_with_drags_ = outcome;
  if (!drags_.empty()) return;
  for (Watcher* watcher : watchers_) watcher->EndWatch(outcome);
}

}  // namespace tissueform
