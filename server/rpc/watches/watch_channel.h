// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>

#include "absl/status/status.h"
#include "grpcpp/support/byte_buffer.h"

#include "core/base/mutex.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// A message as gRPC sends it; copies share the bytes.
using SharedBytes = std::shared_ptr<const grpc::ByteBuffer>;
SharedBytes ToBytes(const v1::WatchResponse& message);

// A frame on its way to the watchers; encoded once for all of them.
struct WatchedFrame {
  uint64_t number = 0;
  std::shared_ptr<const v1::WatchForm> form;
  SharedBytes bytes;  // a WatchResponse
};

// A client that watches. Called with the channel's lock held: must not call the channel, nor block.
class Watcher {
 public:
  virtual void Show(const std::shared_ptr<const WatchedFrame>& frame) = 0;
  virtual void Notify(const v1::DeformNotice& notice) = 0;
  virtual void EndWatch(const absl::Status& outcome) = 0;

 protected:
  ~Watcher() = default;
};

// A client that drags. Called with the channel's lock held, which AddDrag and RemoveDrag take, too:
// must not call the channel, nor take a lock that is held while the channel is called, nor
// block.
class Dragger {
 public:
  virtual void FollowersChanged(int count) = 0;

 protected:
  ~Dragger() = default;
};

// From the drags of one session to its watchers: the newest frame, encoded once on a worker if
// there are watchers. Frames that come faster than they are encoded replace each other.
//
// Thread-safe. Drags hand over a pointer and never wait for watchers.
class WatchChannel : public std::enable_shared_from_this<WatchChannel> {
 public:
  // Made by std::make_shared. `pool` must outlive the channel.
  explicit WatchChannel(WorkerPool* pool) : pool_(pool) {}

  // Of a drag: `response` has a frame of this form, and was just sent to its client.
  void Publish(std::shared_ptr<const v1::DeformResponse> response,
               std::shared_ptr<const v1::WatchForm> form) ABSL_LOCKS_EXCLUDED(newest_mutex_);
  // What is shown until there is a frame of a drag; nothing when there is one.
  void PublishBase(v1::WatchOrigin origin, v1::DeformFrame frame,
                   std::shared_ptr<const v1::WatchForm> form) ABSL_LOCKS_EXCLUDED(newest_mutex_);

  // The dragger is notified if there are watchers already, and whenever the number changes.
  void AddDrag(Dragger* dragger);
  void RemoveDrag(Dragger* dragger);

  // The watcher is shown the newest frame; false if there is no frame: the caller must PublishBase.
  bool Add(Watcher* watcher);
  // REQUIRES: added.
  void Remove(Watcher* watcher);
  size_t num_watchers() const;

  void Notify(const v1::DeformNotice& notice);
  void EndWatches(const absl::Status& outcome);
  // Ends the watches as soon as there are no drags.
  void EndWithDrags(const absl::Status& outcome);

 private:
  struct Newest {
    v1::WatchOrigin origin = v1::WATCH_ORIGIN_DRAG;
    std::chrono::system_clock::time_point time;
    std::shared_ptr<const v1::DeformResponse> response;  // null: none yet
    std::shared_ptr<const v1::WatchForm> form;
  };

  void NotifyDrags() ABSL_EXCLUSIVE_LOCKS_REQUIRED(watchers_mutex_);
  void Put(Newest newest) ABSL_EXCLUSIVE_LOCKS_REQUIRED(newest_mutex_);
  void StartEncoding() ABSL_EXCLUSIVE_LOCKS_REQUIRED(newest_mutex_);
  // On a worker, one at a time.
  void EncodeAll();
  std::optional<Newest> TakeToEncode() ABSL_LOCKS_EXCLUDED(newest_mutex_);

  WorkerPool* const pool_;
  uint64_t last_number_ = 0;  // of the thread that encodes

  mutable Mutex watchers_mutex_;  // before the other, and before the locks of the watchers
  std::set<Watcher*> watchers_ ABSL_GUARDED_BY(watchers_mutex_);
  std::shared_ptr<const WatchedFrame> shown_ ABSL_GUARDED_BY(watchers_mutex_);  // null: none
  std::set<Dragger*> drags_ ABSL_GUARDED_BY(watchers_mutex_);
  std::optional<absl::Status> end_with_drags_ ABSL_GUARDED_BY(watchers_mutex_);

  Mutex newest_mutex_;
  Newest newest_ ABSL_GUARDED_BY(newest_mutex_);
  bool watched_ ABSL_GUARDED_BY(newest_mutex_) = false;
  bool to_encode_ ABSL_GUARDED_BY(newest_mutex_) = false;  // the newest is not encoded
  bool encoding_ ABSL_GUARDED_BY(newest_mutex_) = false;   // a job is under way
};

// A drag's side of a channel. One thread at a time.
class DragPublisher {
 public:
  DragPublisher(Dragger* dragger, std::shared_ptr<WatchChannel> channel, v1::WatchForm form)
      : dragger_(dragger),
        channel_(std::move(channel)),
        form_(std::make_shared<const v1::WatchForm>(std::move(form))) {
    channel_->AddDrag(dragger_);
  }
  // REQUIRES: no lock is held that a watcher may wait for.
  ~DragPublisher() { channel_->RemoveDrag(dragger_); }
  DragPublisher(const DragPublisher&) = delete;
  DragPublisher& operator=(const DragPublisher&) = delete;

  void Publish(std::shared_ptr<const v1::DeformResponse> response) {
    channel_->Publish(std::move(response), form_);
  }

 private:
  Dragger* const dragger_;
  const std::shared_ptr<WatchChannel> channel_;
  const std::shared_ptr<const v1::WatchForm> form_;
};

}  // namespace tissueform
