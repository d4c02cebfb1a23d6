// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/series_intake.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Goes to logs and tables, so it must be what it should be.
std::string ModalityOf(const std::string& text) {
  const bool is_modality = !text.empty() && text.size() <= 16 &&
                           std::all_of(text.begin(), text.end(), [](unsigned char c) {
                             return absl::ascii_isupper(c) || absl::ascii_isdigit(c);
                           });
  return is_modality ? text : "?";
}

constexpr char kCameLate[] =
    "images arrived after its plan was built, or its draft was sent; the plan lacks them";
constexpr char kOfAnotherStudy[] =
    "images of the same series name another study; check their sender";

bool IsBuilt(SeriesState state) {
  return state == SeriesState::kBuilt || state == SeriesState::kPacked ||
         state == SeriesState::kPublished || state == SeriesState::kDraft;
}

bool HasPlan(SeriesState state) {
  return state == SeriesState::kChosen || state == SeriesState::kDrafting || IsBuilt(state);
}

}  // namespace

SeriesIntake::SeriesIntake(BridgeQueue* queue, SeriesIntakeOptions options)
    : queue_(queue), options_(std::move(options)), rows_(queue) {}

void SeriesIntake::Arrived(const std::string& file, const InstanceHeader& image) {
  MutexLock lock(mutex_);
  arrivals_.push_back({file, image});
  progress_[image.series_uid] = {.last = options_.now()};
  studies_[image.study_uid] = {.last = options_.now()};
}

void SeriesIntake::Ended(const std::vector<std::string>& series_uids, bool released) {
  MutexLock lock(mutex_);
  for (const std::string& uid : series_uids) {
    const auto found = progress_.find(uid);
    if (found == progress_.end()) continue;
    found->second.ended = true;
    found->second.aborted = !released;
  }
}

absl::Status SeriesIntake::Recover() {
  std::set<std::string> known;
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, rows_.List());
  for (const QueuedSeries& series : all) {
    TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows_.ListImages(series.key));
    for (const QueuedImage& image : images) known.insert(image.file);
    if (series.state != SeriesState::kReceiving) continue;
    MutexLock lock(mutex_);
    progress_[series.uid] = {.last = options_.now()};
  }
  std::error_code error;
  for (fs::recursive_directory_iterator file(queue_->received_folder(), error), end; file != end;
       file.increment(error)) {
    if (error) break;
    const std::string path = file->path().string();
    if (!file->is_regular_file(error) || known.contains(path)) continue;
    const absl::StatusOr<InstanceHeader> image = ReadInstanceHeader(path);
    if (image.ok()) Arrived(path, *image);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> SeriesIntake::RemarkOn(const QueuedSeries& series,
                                                                const std::string& remark) {
  TF_ASSIGN_OR_RETURN(const bool is_new, rows_.Remark(series.key, remark));
  return is_new ? std::vector<std::string>{series.key} : std::vector<std::string>();
}

absl::StatusOr<std::vector<std::string>> SeriesIntake::PutSeries(
    const std::vector<const Arrival*>& arrivals) {
  const InstanceHeader& first = arrivals.front()->image;
  const QueuedStudy study = {.uid = first.study_uid,
                             .patient = IdentityOf(first),
                             .date = first.study_date,
                             .description = first.study_description};
  QueuedSeries series;
  series.study_uid = first.study_uid;
  series.uid = first.series_uid;
  series.frame_uid = first.frame_uid;
  series.modality = ModalityOf(first.modality);
  series.first_s = std::time(nullptr);
  bool one_patient = true;
  std::vector<QueuedImage> images;
  for (const Arrival* arrival : arrivals) {
    one_patient = one_patient && IdentityOf(arrival->image) == study.patient &&
                  arrival->image.study_uid == study.uid;
    images.push_back({.uid = arrival->image.instance_uid,
                      .class_uid = arrival->image.class_uid,
                      .file = arrival->file});
  }
  const absl::StatusOr<QueuedSeries> before = rows_.GetByUid(series.uid);
  if (!before.ok() && !absl::IsNotFound(before.status())) return before.status();
  const absl::StatusOr<QueuedSeries> kept = rows_.Add(study, series, NewQueueKey(), images);
  // Of two studies at once: it stays on the disk, and nothing is made of it.
  if (absl::IsFailedPrecondition(kept.status()) && before.ok()) {
    if (HasPlan(before->state)) return RemarkOn(*before, kOfAnotherStudy);
    TF_RETURN_IF_ERROR(Write(*before, SeriesState::kFailed, kOfAnotherStudy));
    return std::vector<std::string>{before->key};
  }
  TF_RETURN_IF_ERROR(kept.status());
  if (kept->state != SeriesState::kReceiving) {  // images that came again, or late
    MutexLock lock(mutex_);
    progress_.erase(kept->uid);
  }
  TF_ASSIGN_OR_RETURN(const QueuedStudy known, rows_.GetStudy(study.uid));
  const bool same_patient = one_patient && known.patient == study.patient;
  if (!same_patient && !HasPlan(kept->state)) {
    TF_RETURN_IF_ERROR(Write(*kept, SeriesState::kFailed,
                             "its images name different patients; check their sender"));
    return std::vector<std::string>{kept->key};
  }
  if (IsBuilt(kept->state) && before.ok() && kept->images > before->images) {
    return RemarkOn(*kept, kCameLate);
  }
  return std::vector<std::string>();
}

absl::StatusOr<std::vector<std::string>> SeriesIntake::Flush() {
  std::vector<Arrival> arrivals;
  {
    MutexLock lock(mutex_);
    arrivals.swap(arrivals_);
  }
  std::map<std::string, std::vector<const Arrival*>> by_series;
  for (const Arrival& arrival : arrivals) by_series[arrival.image.series_uid].push_back(&arrival);
  std::vector<std::string> changed;
  for (const auto& [uid, of_series] : by_series) {
    const absl::StatusOr<std::vector<std::string>> keys = PutSeries(of_series);
    if (!keys.ok()) {
      // What was put there already is known by its UID the next time.
      MutexLock lock(mutex_);
      arrivals_.insert(arrivals_.begin(), arrivals.begin(), arrivals.end());
      return keys.status();
    }
    changed.insert(changed.end(), keys->begin(), keys->end());
  }
  TF_FAULT_POINT("intake.flushed");
  return changed;
}

const std::vector<SeriesSummary>* SeriesIntake::AskPacs(const std::string& study_uid) {
  if (!options_.find_series) return nullptr;
  auto found = pacs_series_.find(study_uid);
  if (found == pacs_series_.end()) {
    found = pacs_series_.emplace(study_uid, options_.find_series(study_uid)).first;
  }
  return found->second.ok() ? &*found->second : nullptr;
}

absl::StatusOr<std::optional<SeriesState>> SeriesIntake::Judge(const QueuedSeries& series) {
  Progress progress;
  {
    MutexLock lock(mutex_);
    progress = progress_.try_emplace(series.uid, Progress{.last = options_.now()}).first->second;
  }
  const bool quiet = options_.now() - progress.last >= options_.quiet;
  if (!quiet && (!progress.ended || progress.aborted || progress.asked)) return std::nullopt;
  std::optional<int64_t> expected;
  if (const std::vector<SeriesSummary>* const study = AskPacs(series.study_uid)) {
    for (const SeriesSummary& summary : *study) {
      if (summary.series_uid == series.uid && summary.instances > 0) expected = summary.instances;
    }
  }
  {
    MutexLock lock(mutex_);
    progress_[series.uid].asked = true;
  }
  TF_ASSIGN_OR_RETURN(const QueuedSeries counted, rows_.Get(series.key));
  if (expected.has_value() && counted.images >= *expected) return SeriesState::kComplete;
  if (!quiet) return std::nullopt;
  if (expected.has_value() || progress.aborted) return SeriesState::kIncomplete;
  TF_ASSIGN_OR_RETURN(const SeriesFacts facts, FactsOf(series));
  return facts.missing > 0 ? SeriesState::kIncomplete : SeriesState::kComplete;
}

bool SeriesIntake::MayBeChosen(const SeriesSummary& series) const {
  return series.modality.empty() || std::any_of(options_.rules.begin(), options_.rules.end(),
                                                [&series](const SeriesRule& rule) {
                                                  return rule.modality == series.modality;
                                                });
}

absl::StatusOr<bool> SeriesIntake::IsAllThere(const std::string& study_uid) {
  StudyProgress progress;
  {
    MutexLock lock(mutex_);
    StudyProgress& kept =
        studies_.try_emplace(study_uid, StudyProgress{.last = options_.now()}).first->second;
    progress = std::exchange(kept, {.last = kept.last, .asked = true});
  }
  if (options_.now() - progress.last >= options_.quiet) return true;
  if (progress.asked) return false;
  const std::vector<SeriesSummary>* const reported = AskPacs(study_uid);
  if (reported == nullptr) return false;
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> known, rows_.ListStudy(study_uid));
  std::map<std::string, int64_t> images;
  for (const QueuedSeries& series : known) images[series.uid] = series.images;
  return std::all_of(reported->begin(), reported->end(), [&](const SeriesSummary& series) {
    const auto found = images.find(series.series_uid);
    return !MayBeChosen(series) || (found != images.end() && found->second >= series.instances);
  });
}

void SeriesIntake::ForgetOldStudies(const std::set<std::string>& waiting) {
  MutexLock lock(mutex_);
  std::erase_if(studies_, [&](const auto& study) {
    return !waiting.contains(study.first) && options_.now() - study.second.last >= options_.quiet;
  });
}

absl::StatusOr<std::vector<std::string>> SeriesIntake::Settle() {
  pacs_series_.clear();
  TF_ASSIGN_OR_RETURN(std::vector<std::string> changed, Flush());
  std::set<std::string> busy;
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> receiving,
                      rows_.ListOfState(SeriesState::kReceiving));
  for (const QueuedSeries& series : receiving) {
    TF_ASSIGN_OR_RETURN(const std::optional<SeriesState> judged, Judge(series));
    if (!judged.has_value()) {
      busy.insert(series.study_uid);
      continue;
    }
    TF_RETURN_IF_ERROR(Write(
        series, *judged,
        *judged == SeriesState::kIncomplete ? "it is incomplete; send the missing images" : ""));
    changed.push_back(series.key);
    MutexLock lock(mutex_);
    if (const auto study = studies_.find(series.study_uid); study != studies_.end()) {
      study->second.asked = false;
    }
  }
  std::set<std::string> waiting = busy;
  if (!options_.rules.empty()) {
    TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> complete,
                        rows_.ListOfState(SeriesState::kComplete));
    for (const QueuedSeries& series : complete) {
      if (!waiting.insert(series.study_uid).second) continue;
      TF_ASSIGN_OR_RETURN(const bool all_there, IsAllThere(series.study_uid));
      if (!all_there) continue;
      TF_ASSIGN_OR_RETURN(const std::vector<std::string> keys, ChooseOfStudy(series.study_uid));
      changed.insert(changed.end(), keys.begin(), keys.end());
    }
  }
  ForgetOldStudies(waiting);
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  return changed;
}

absl::StatusOr<SeriesFacts> SeriesIntake::FactsOf(const QueuedSeries& series) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows_.ListImages(series.key));
  std::vector<ImageHeader> headers;
  for (const QueuedImage& image : images) {
    if (image.file.empty()) continue;
    TF_ASSIGN_OR_RETURN(headers.emplace_back(), ReadInstanceHeader(image.file));
  }
  if (headers.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the images of series ", series.key, " are deleted"));
  }
  return FactsOfSeries(series.key, headers);
}

absl::StatusOr<std::vector<std::string>> SeriesIntake::ChooseOfStudy(const std::string& study_uid) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, rows_.ListStudy(study_uid));
  const bool has_plan = std::any_of(
      all.begin(), all.end(), [](const QueuedSeries& series) { return HasPlan(series.state); });
  std::vector<QueuedSeries> candidates;
  std::vector<SeriesFacts> facts;
  std::vector<std::string> changed;
  for (const QueuedSeries& series : all) {
    const bool fits = series.state == SeriesState::kComplete ||
                      (series.state == SeriesState::kPassedOver && series.has_files);
    if (!fits) continue;
    if (series.state == SeriesState::kComplete) changed.push_back(series.key);
    if (has_plan) {
      if (series.state == SeriesState::kComplete) {
        TF_RETURN_IF_ERROR(Write(series, SeriesState::kPassedOver,
                                 "another series of the study was received first"));
      }
      continue;
    }
    const absl::StatusOr<SeriesFacts> read = FactsOf(series);
    if (!read.ok()) {
      TF_RETURN_IF_ERROR(Write(series, SeriesState::kFailed, "its images cannot be read"));
      continue;
    }
    candidates.push_back(series);
    // When the series was new, that of whichever of its objects came first.
    candidates.back().modality = ModalityOf(read->modality);
    facts.push_back(*read);
  }
  const std::vector<SeriesVerdict> verdicts = PickSeries(facts, options_.rules);
  for (size_t i = 0; i < verdicts.size(); ++i) {
    if (verdicts[i].chosen) {
      const SeriesRule& rule = options_.rules[static_cast<size_t>(verdicts[i].rule)];
      TF_RETURN_IF_ERROR(Choose(candidates[i], rule.recipe, verdicts[i].reason,
                                rule.draft ? SeriesState::kDrafting : SeriesState::kChosen));
    } else {
      TF_RETURN_IF_ERROR(Write(candidates[i], SeriesState::kPassedOver, verdicts[i].reason));
    }
  }
  return changed;
}

absl::Status SeriesIntake::KeepHeader(QueuedSeries* series) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows_.ListImages(series->key));
  if (images.empty() || images.front().file.empty()) {
    return absl::FailedPreconditionError("the images of the series are deleted");
  }
  const std::string source = SourcesAmong(images).front().file;
  TF_RETURN_IF_ERROR(CopyHeaderOnly(source, queue_->header_path(series->key)));
  series->has_header = true;
  return absl::OkStatus();
}

absl::Status SeriesIntake::Choose(QueuedSeries series, const std::string& recipe,
                                  const std::string& reason, SeriesState next) {
  if (series.state == SeriesState::kReceiving || series.state == SeriesState::kIncomplete) {
    return absl::FailedPreconditionError(
        absl::StrCat("series ", series.key, " is ", SeriesStateName(series.state), ": not built"));
  }
  if (recipe.empty()) return absl::FailedPreconditionError("no recipe; give --recipe FILE");
  TF_RETURN_IF_ERROR(KeepHeader(&series));
  // A plan that is there is one of other images, or by another recipe.
  std::error_code failed;
  fs::remove_all(queue_->plan_path(series.key), failed);
  if (failed) return FileError(failed.value(), "cannot remove", queue_->plan_path(series.key));
  TF_FAULT_POINT("intake.header_kept");
  series.recipe = recipe;
  series.attempts = 0;
  series.last_error.clear();
  return Write(std::move(series), next, reason);
}

absl::Status SeriesIntake::Write(QueuedSeries series, SeriesState state,
                                 const std::string& reason) {
  series.state = state;
  series.reason = reason;
  const bool done = state == SeriesState::kPassedOver || state == SeriesState::kFailed ||
                    state == SeriesState::kIncomplete || state == SeriesState::kComplete;
  series.done_s = done ? std::time(nullptr) : 0;
  if (state != SeriesState::kReceiving) {
    MutexLock lock(mutex_);
    progress_.erase(series.uid);
  }
  return rows_.Update(series);
}

}  // namespace tissueform
