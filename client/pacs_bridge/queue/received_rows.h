// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "client/pacs_bridge/queue/queued_series.h"

namespace tissueform {

// What was received. Copies nothing of its queue, which must outlive it. Thread-safe.
class ReceivedRows {
 public:
  explicit ReceivedRows(BridgeQueue* queue) : queue_(queue) {}

  // Puts images of one series there, and the series and its study where they are new: then `series`
  // gets `new_key` as its key. An image that is there stays. Something new makes a series
  // kReceiving again of which nothing is built: what was decided was decided of a part. Returns the
  // series as it is now.
  //
  // Errors: FailedPrecondition: the series is known as one of another study.
  absl::StatusOr<QueuedSeries> Add(const QueuedStudy& study, const QueuedSeries& series,
                                   const std::string& new_key,
                                   const std::vector<QueuedImage>& images);

  // Writes all of the series but its key and UIDs. Errors: NotFound.
  absl::Status Update(const QueuedSeries& series);
  // Writes what a step of work changes (state, case, attempts, last error, done) where the series
  // still is in the state `before`, and, where it was chosen, has as many images as `series`.
  // Errors: Aborted: it is not; nothing is written.
  absl::Status UpdateStep(const QueuedSeries& series, SeriesState before);
  // Adds to the reason, once. Returns whether it was not there.
  absl::StatusOr<bool> Remark(const std::string& key, const std::string& remark);

  absl::StatusOr<QueuedSeries> Get(const std::string& key);  // NotFound
  absl::StatusOr<QueuedSeries> GetByUid(const std::string& uid);
  // Of which series a case was made, the present one or an earlier one; NotFound: none of this
  // bridge.
  absl::StatusOr<QueuedSeries> GetByCase(const std::string& case_name);
  absl::StatusOr<std::vector<QueuedSeries>> List();
  // Without their number of images, as often as one likes.
  absl::StatusOr<std::vector<QueuedSeries>> ListOfState(SeriesState state);
  absl::StatusOr<std::vector<QueuedSeries>> ListStudy(const std::string& study_uid);
  absl::StatusOr<QueuedStudy> GetStudy(const std::string& uid);
  absl::StatusOr<std::vector<QueuedImage>> ListImages(const std::string& series);
  // The images that a case was made of.
  absl::StatusOr<std::vector<QueuedImage>> ListSources(const std::string& case_name);
  // Takes the images' files out of the queue before they are deleted; the images stay known.
  absl::Status ForgetFiles(const std::string& series);
  // All that is known of a series, and of its study where that has no other.
  absl::Status Forget(const std::string& series);

 private:
  absl::StatusOr<std::vector<QueuedSeries>> Select(const char* sql, const std::string& value);
  absl::StatusOr<QueuedSeries> SelectOne(const char* sql, const std::string& value);

  BridgeQueue* const queue_;
};

}  // namespace tissueform
