// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/dicom/instance_header.h"
#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "core/base/mutex.h"
#include "core/imaging/series/series_pick.h"

namespace tissueform {

struct SeriesIntakeOptions {
  std::vector<SeriesRule> rules = {};  // none: nothing is chosen
  // A series is complete, or has stopped midway, when nothing came for so long.
  std::chrono::milliseconds quiet{30'000};
  // What the PACS has of a study; empty, or an error: unknown. Called on the thread of Settle.
  std::function<absl::StatusOr<std::vector<SeriesSummary>>(const std::string& study_uid)>
      find_series = {};
  std::function<std::chrono::steady_clock::time_point()> now = std::chrono::steady_clock::now;
};

// Takes what is received into the queue, finds out when a series is complete, and chooses which one
// of its study becomes a plan.
//
// A file that is on the disk is received: its sender may get an answer before the queue knows it,
// and Recover finds it there after a crash. A series is complete
//   * when its association has ended and the queue has as many images as the PACS says, at once;
//   * when nothing came for `quiet`, and the PACS confirms it; or the PACS does not know, its
//     association was released by its sender, and no slice between first and last is missing.
// Otherwise it is incomplete after `quiet`, and nothing is made of it unless more comes.
//
// One of a study is chosen when none of it is being received and
//   * the queue has all that the PACS says of the study, of modalities that a rule takes: at once;
//   * or nothing of the study came for `quiet`: a PACS may send one series after the other, or send
//     while it receives itself.
// What comes of a series later undoes its choice until a plan is built of it; after that its reason
// says that the plan lacks it.
//
// Arrived and Ended: any thread. The others: one thread.
class SeriesIntake {
 public:
  SeriesIntake(BridgeQueue* queue, SeriesIntakeOptions options);

  // An image is in a file. Blocks for no disk.
  void Arrived(const std::string& file, const InstanceHeader& image) ABSL_LOCKS_EXCLUDED(mutex_);
  // All that an association has brought is there; `released`: it was not aborted.
  void Ended(const std::vector<std::string>& series_uids, bool released)
      ABSL_LOCKS_EXCLUDED(mutex_);

  // At the start: takes files in that a crash has kept from the queue. Files that are no DICOM stay
  // and are not looked at. Errors: those of the queue.
  absl::Status Recover();

  // Puts what has arrived into the queue, and moves series on by the clock. Returns keys of series
  // whose state or reason has changed. Errors: those of the queue; what was to be put there is
  // kept.
  absl::StatusOr<std::vector<std::string>> Settle();

  // What a series is, by its files. Errors: FailedPrecondition: its files are deleted; those of
  // ReadInstanceHeader.
  absl::StatusOr<SeriesFacts> FactsOf(const QueuedSeries& series);

  // Makes a series the one that becomes a plan or a draft, against the rules if need be: a person
  // has chosen it. Errors: FailedPrecondition: it is not complete, or no recipe.
  absl::Status Choose(QueuedSeries series, const std::string& recipe, const std::string& reason,
                      SeriesState next = SeriesState::kChosen);

 private:
  struct Arrival {
    std::string file = {};
    InstanceHeader image = {};
  };
  // Of a series that is being received.
  struct Progress {
    std::chrono::steady_clock::time_point last = {};
    bool ended = false;    // since the last image
    bool aborted = false;  // the last association that has brought some
    bool asked = false;    // the PACS, since the last image
  };

  // Of a study of which something came lately.
  struct StudyProgress {
    std::chrono::steady_clock::time_point last = {};
    bool asked = false;  // the PACS, since something has changed
  };

  // Both return keys of series that have news to report.
  absl::StatusOr<std::vector<std::string>> Flush();
  absl::StatusOr<std::vector<std::string>> PutSeries(const std::vector<const Arrival*>& arrivals);
  absl::StatusOr<std::vector<std::string>> RemarkOn(const QueuedSeries& series,
                                                    const std::string& remark);
  // Complete, incomplete, or nothing as long as it may go on.
  absl::StatusOr<std::optional<SeriesState>> Judge(const QueuedSeries& series);
  // Whether nothing that may be chosen of a study is still to come.
  absl::StatusOr<bool> IsAllThere(const std::string& study_uid);
  // What the PACS has of a study, asked once in a round of Settle; null: unknown.
  const std::vector<SeriesSummary>* AskPacs(const std::string& study_uid);
  bool MayBeChosen(const SeriesSummary& series) const;
  void ForgetOldStudies(const std::set<std::string>& waiting);
  absl::StatusOr<std::vector<std::string>> ChooseOfStudy(const std::string& study_uid);
  absl::Status Write(QueuedSeries series, SeriesState state, const std::string& reason);
  absl::Status KeepHeader(QueuedSeries* series);

  // Constant.
  BridgeQueue* const queue_;
  const SeriesIntakeOptions options_;

  ReceivedRows rows_;
  // Of the thread of Settle.
  std::map<std::string, absl::StatusOr<std::vector<SeriesSummary>>> pacs_series_;  // by study

  Mutex mutex_;
  std::vector<Arrival> arrivals_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, Progress> progress_ ABSL_GUARDED_BY(mutex_);  // by UID
  std::map<std::string, StudyProgress> studies_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
