// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/queue/draft_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "client/pacs_bridge/work/case_server.h"

namespace tissueform {

struct PlanBuildAnswer;
struct PlanBuildRequest;

struct PlanWorkOptions {
  int threads = 0;         // of `plan build`; 0: all processors
  int max_seconds = 3600;  // of processor time
  int64_t max_memory_bytes = int64_t{16} << 30;
  bool pictures = false;        // in the report: they need Xvfb
  bool accept_defects = false;  // publish also a plan that is not ready
  // Readable when the work is to end; -1: never.
  int cancel = -1;
  // Receives what begins and how much of building is done; may be empty.
  std::function<void(const std::string& series, absl::string_view stage, double fraction)>
      on_progress = {};
};

// From a chosen series to a case on the server, one durable step after the other:
//
//   chosen     `plan build` by the rule's recipe, as a limited child, into plans/KEY/plan
//   built      `case pack` into plans/KEY/{sha256}.tfcase, which names the case
//   packed     the case to the server
//   published
//
// Or to a draft there, which a person makes a case of:
//
//   drafting   the CT without what names the patient, and the recipe, to the server
//   draft      FollowDrafts: until the server reports a case, or no longer the draft
//   published
//
// Every step may be repeated: a folder appears at once, a case is named by its bytes before it is
// sent. Neither the plan's folder nor the case names a patient: they see pixels and geometry only,
// and folder and title are named by the series' random key.
//
// One thread at a time. `queue` and `server` must outlive it; `server` may be null for what does
// not publish.
class PlanWork {
 public:
  PlanWork(BridgeQueue* queue, CaseServer* server, PlanWorkOptions options)
      : queue_(queue),
        rows_(queue),
        drafts_(queue),
        server_(server),
        options_(std::move(options)) {}

  // The next step of `series`, which was read from the queue, and whose new state is written there
  // and into it. An error that is not transient makes the series kFailed, with the reason; the
  // others count an attempt.
  //
  // Errors: those of the step, for the log; they hold nothing of a patient. Aborted: more images
  // have come while the plan was built: it is thrown away, and `series` is read again.
  absl::Status Step(QueuedSeries* series);

  // Asks the server what was made of the drafts there: each case is noted as one of its series.
  // Returns keys of series whose state has changed. Sends no request without drafts.
  absl::StatusOr<std::vector<std::string>> FollowDrafts();

 private:
  // Calls tissueform-plan-build with the images and the recipe of the series.
  absl::StatusOr<PlanBuildAnswer> CallOn(const QueuedSeries& series, PlanBuildRequest request);
  absl::Status Build(QueuedSeries* series);
  absl::Status SendDraft(QueuedSeries* series);
  // What was sent of the series before, and nothing was built of.
  absl::Status RemoveDrafts(const std::string& series);
  // True: its series has changed.
  absl::StatusOr<bool> TakeCases(const QueuedDraft& draft, const v1::BuildDraft& listed);
  absl::StatusOr<bool> TakeLoss(const QueuedDraft& draft);
  absl::Status Pack(QueuedSeries* series);
  absl::Status Publish(QueuedSeries* series);

  BridgeQueue* const queue_;
  ReceivedRows rows_;
  DraftRows drafts_;
  CaseServer* const server_;
  const PlanWorkOptions options_;
};

// What a case of the series is called where others see it: "Case 1a2b3c4d".
std::string TitleOfSeries(const std::string& key);
// The file of a case ("cases/{sha256}") in the plan's folder; a series has another one for every
// plan that was built of it.
std::string CasePathOf(const BridgeQueue& queue, const std::string& series,
                       const std::string& case_name);

}  // namespace tissueform
