// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/plan_work.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/base/atomic_folder.h"
#include "core/base/backoff.h"
#include "core/base/error_reason.h"
#include "core/base/parallel_for.h"
#include "core/base/process/tissueform_command.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// For `case pack`, which takes seconds.
constexpr std::chrono::minutes kPackTime{10};
constexpr int64_t kMaxPackAttempts = 20;
constexpr int64_t kMaxDraftAttempts = 1'000;
constexpr size_t kMaxErrorBytes = 512;
constexpr size_t kMaxDraftBytes = size_t{4} << 30;
constexpr size_t kCaseTitleDigits = 8;
constexpr char kCases[] = "cases/";

// Links the images of one series into a folder of their own, without the other files next to them.
absl::Status LinkImages(const std::vector<QueuedImage>& images, const std::string& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].file.empty()) {
      return absl::FailedPreconditionError(
          "the images of the series were deleted; send them again from the PACS");
    }
    fs::create_hard_link(images[i].file, absl::StrCat(folder, "/", i, ".dcm"), error);
    if (error) return FileError(error.value(), "cannot link an image into", folder);
  }
  return absl::OkStatus();
}

absl::Status NoServer() {
  return absl::FailedPreconditionError("no server to publish to; give --server HOST:PORT");
}

// A draft has one file, its CT.
absl::Status CheckNoOtherFiles(const std::string& inputs) {
  std::error_code error;
  for (fs::directory_iterator file(inputs, error), end; !error && file != end;
       file.increment(error)) {
    const std::string name = file->path().filename().string();
    if (name == BuildInputFiles::kCt || name == BuildInputFiles::kRecipe) continue;
    return absl::FailedPreconditionError(
        "the recipe names a label map or other files, which a draft cannot have; use a recipe "
        "without them, or build the series without a draft");
  }
  return error ? FileError(error.value(), "cannot read", inputs) : absl::OkStatus();
}

absl::StatusOr<std::string> ReadFile(const std::string& path, size_t max_bytes) {
  std::string bytes;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&bytes, max_bytes](absl::string_view piece) {
    if (bytes.size() + piece.size() > max_bytes) {
      return absl::FailedPreconditionError("a case or a CT is larger than the limit");
    }
    absl::StrAppend(&bytes, piece);
    return absl::OkStatus();
  }));
  return bytes;
}

// Building takes long and comes out the same again, unless there was no room; packing fails for
// want of room, too, but its program does not say so; publishing waits for the server.
bool MayRetry(SeriesState step, const absl::Status& status, int64_t attempts) {
  if (HasReason(status, ErrorReason::kDiskFull)) return true;
  if (step == SeriesState::kBuilt) return attempts < kMaxPackAttempts;
  // A CT that does not fit into memory is refused in the same words as by a server without room.
  if (step == SeriesState::kDrafting && attempts >= kMaxDraftAttempts) return false;
  return (step == SeriesState::kPacked || step == SeriesState::kDrafting) && IsTransient(status);
}

}  // namespace

std::string TitleOfSeries(const std::string& key) {
  return absl::StrCat("Case ", key.substr(0, kCaseTitleDigits));
}

std::string CasePathOf(const BridgeQueue& queue, const std::string& series,
                       const std::string& case_name) {
  return absl::StrCat(queue.plan_folder(series), "/", absl::StripPrefix(case_name, kCases),
                      ".tfcase");
}

absl::Status PlanWork::Step(QueuedSeries* series) {
  const SeriesState before = series->state;
  absl::Status status;
  switch (before) {
    case SeriesState::kChosen:
      status = Build(series);
      break;
    case SeriesState::kBuilt:
      status = Pack(series);
      break;
    case SeriesState::kPacked:
      status = Publish(series);
      break;
    case SeriesState::kDrafting:
      status = SendDraft(series);
      break;
    default:
      return absl::FailedPreconditionError(absl::StrCat(
          "series ", series->key, " is ", SeriesStateName(before), ": it has no next step"));
  }
  if (absl::IsCancelled(status)) return status;
  if (status.ok()) {
    series->attempts = 0;
    series->last_error.clear();
  } else {
    series->state = before;
    ++series->attempts;
    series->last_error = std::string(status.message()).substr(0, kMaxErrorBytes);
    if (!MayRetry(before, status, series->attempts)) {
      series->state = SeriesState::kFailed;
      series->done_s = std::time(nullptr);
    }
  }
  TF_FAULT_POINT("plan.stepped");
  const absl::Status kept = rows_.UpdateStep(*series, before);
  if (absl::IsAborted(kept)) {
    // The plan lacks what has come while it was built.
    std::error_code ignored;
    fs::remove_all(queue_->plan_path(series->key), ignored);
    TF_ASSIGN_OR_RETURN(*series, rows_.Get(series->key));
  }
  TF_RETURN_IF_ERROR(kept);
  return status;
}

absl::StatusOr<PlanBuildAnswer> PlanWork::CallOn(const QueuedSeries& series,
                                                 PlanBuildRequest request) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows_.ListImages(series.key));
  request.ct = queue_->plan_folder(series.key) + "/ct";
  const absl::Cleanup remove_links = [&request] {
    std::error_code failed;
    fs::remove_all(request.ct, failed);
  };
  TF_RETURN_IF_ERROR(LinkImages(images, request.ct));
  TF_FAULT_POINT("plan.linked");
  request.recipe = series.recipe;
  request.threads = options_.threads > 0 ? options_.threads : AvailableProcessors();
  request.pictures = options_.pictures;
  request.limits = {.max_memory_bytes = options_.max_memory_bytes,
                    .max_seconds = options_.max_seconds,
                    .max_file_bytes = int64_t{4} << 30};
  PlanBuildCallOptions calling;
  if (options_.on_progress) {
    calling.on_progress = [&](absl::string_view stage, double fraction) {
      options_.on_progress(series.key, stage, fraction);
    };
  }
  calling.cancel = options_.cancel;
  return CallPlanBuild(request, calling);
}

absl::Status PlanWork::Build(QueuedSeries* series) {
  const std::string plan = queue_->plan_path(series->key);
  TF_RETURN_IF_ERROR(MakeFolder(queue_->plan_folder(series->key)));
  std::error_code ignored;
  if (!fs::exists(plan + "/plan.json", ignored)) {
    TF_ASSIGN_OR_RETURN(AtomicFolder goal, AtomicFolder::Create(plan));
    PlanBuildRequest request;
    request.folder = goal.path();
    request.folder_name = "plan";
    TF_ASSIGN_OR_RETURN(const PlanBuildAnswer made, CallOn(*series, std::move(request)));
    if (!made.ready && !options_.accept_defects) {
      return absl::FailedPreconditionError(absl::StrCat("the plan is not ready: ", made.defects));
    }
    TF_RETURN_IF_ERROR(goal.Publish());
  }
  TF_FAULT_POINT("plan.built");
  series->state = SeriesState::kBuilt;
  return absl::OkStatus();
}

absl::Status PlanWork::SendDraft(QueuedSeries* series) {
  if (server_ == nullptr) return NoServer();
  TF_RETURN_IF_ERROR(MakeFolder(queue_->plan_folder(series->key)));
  const std::string inputs = queue_->plan_folder(series->key) + "/draft";
  const absl::Cleanup remove_inputs = [&inputs] {
    std::error_code failed;
    fs::remove_all(inputs, failed);
  };
  std::error_code ignored;
  fs::remove_all(inputs, ignored);
  TF_RETURN_IF_ERROR(MakeFolder(inputs));
  PlanBuildRequest request;
  request.only_write_inputs = true;
  request.folder = inputs;
  request.folder_name = "draft";
  TF_RETURN_IF_ERROR(CallOn(*series, std::move(request)).status());
  TF_RETURN_IF_ERROR(CheckNoOtherFiles(inputs));
  TF_ASSIGN_OR_RETURN(const std::string ct,
                      ReadFile(absl::StrCat(inputs, "/", BuildInputFiles::kCt), kMaxDraftBytes));
  TF_ASSIGN_OR_RETURN(
      const std::string recipe,
      ReadFile(absl::StrCat(inputs, "/", BuildInputFiles::kRecipe), kMaxDraftBytes));
  TF_RETURN_IF_ERROR(RemoveDrafts(series->key));
  TF_FAULT_POINT("plan.drafting");
  TF_ASSIGN_OR_RETURN(const std::string name,
                      server_->SendDraft(ct, TitleOfSeries(series->key), recipe));
  TF_FAULT_POINT("plan.drafted");
  TF_RETURN_IF_ERROR(drafts_.Add({.name = name, .series = series->key, .images = series->images}));
  series->state = SeriesState::kDraft;
  return absl::OkStatus();
}

absl::Status PlanWork::RemoveDrafts(const std::string& series) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedDraft> drafts, drafts_.List());
  for (const QueuedDraft& draft : drafts) {
    if (draft.series != series) continue;
    const absl::Status removed = server_->RemoveDraft(draft.name);
    // One that a plan is being built of stays, and its case is one of the series.
    if (absl::IsFailedPrecondition(removed)) continue;
    if (!removed.ok() && !absl::IsNotFound(removed)) return removed;
    TF_RETURN_IF_ERROR(drafts_.Remove(draft.name));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> PlanWork::FollowDrafts() {
  std::vector<std::string> changed;
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedDraft> drafts, drafts_.List());
  if (drafts.empty() || server_ == nullptr) return changed;
  TF_ASSIGN_OR_RETURN(const std::vector<v1::BuildDraft> listed, server_->ListDrafts());
  for (const QueuedDraft& draft : drafts) {
    const auto found =
        std::find_if(listed.begin(), listed.end(),
                     [&draft](const v1::BuildDraft& one) { return one.name() == draft.name; });
    TF_ASSIGN_OR_RETURN(const bool has_changed,
                        found == listed.end() ? TakeLoss(draft) : TakeCases(draft, *found));
    if (has_changed) changed.push_back(draft.series);
  }
  return changed;
}

absl::StatusOr<bool> PlanWork::TakeCases(const QueuedDraft& draft, const v1::BuildDraft& listed) {
  if (listed.cases().empty()) return false;
  for (const std::string& name : listed.cases()) TF_RETURN_IF_ERROR(drafts_.AddCase(draft, name));
  TF_FAULT_POINT("plan.case_noted");
  TF_ASSIGN_OR_RETURN(QueuedSeries series, rows_.Get(draft.series));
  const std::string& last = listed.cases(listed.cases_size() - 1);
  const SeriesState before = series.state;
  // A plan that was built of the series otherwise stays the one that is shown.
  const bool is_of_draft = std::find(listed.cases().begin(), listed.cases().end(),
                                     series.case_name) != listed.cases().end();
  if (before != SeriesState::kDraft && (!is_of_draft || series.case_name == last)) return false;
  series.case_name = last;
  series.state = SeriesState::kPublished;
  series.done_s = std::time(nullptr);
  series.last_error.clear();
  TF_RETURN_IF_ERROR(rows_.UpdateStep(series, before));
  return true;
}

absl::StatusOr<bool> PlanWork::TakeLoss(const QueuedDraft& draft) {
  TF_ASSIGN_OR_RETURN(QueuedSeries series, rows_.Get(draft.series));
  const bool is_lost = series.state == SeriesState::kDraft;
  if (is_lost) {
    series.state = SeriesState::kFailed;
    series.done_s = std::time(nullptr);
    series.last_error =
        "its draft was removed, or its time was over; `tissueform-pacs draft` sends it again";
    TF_RETURN_IF_ERROR(rows_.UpdateStep(series, SeriesState::kDraft));
  }
  TF_RETURN_IF_ERROR(drafts_.Remove(draft.name));
  return is_lost;
}

absl::Status PlanWork::Pack(QueuedSeries* series) {
  const std::string folder = queue_->plan_folder(series->key);
  const std::string fresh = folder + "/case.new";
  TF_RETURN_IF_ERROR(RunTissueform({"case", "pack", folder + "/plan/plan.json", "--out", fresh,
                                    "--title", TitleOfSeries(series->key), "--overwrite"},
                                   "packing the case", folder + "/pack.log", kPackTime,
                                   options_.cancel));
  TF_FAULT_POINT("plan.packed");
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(fresh, O_RDWR));
  TF_RETURN_IF_ERROR(file.Sync());
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(fresh, kMaxCaseBytes));
  series->case_name = absl::StrCat(kCases, Sha256Hex({bytes}));
  TF_RETURN_IF_ERROR(RenameDurably(fresh, CasePathOf(*queue_, series->key, series->case_name)));
  series->state = SeriesState::kPacked;
  return absl::OkStatus();
}

absl::Status PlanWork::Publish(QueuedSeries* series) {
  if (server_ == nullptr) return NoServer();
  TF_ASSIGN_OR_RETURN(const std::string bytes,
                      ReadFile(CasePathOf(*queue_, series->key, series->case_name), kMaxCaseBytes));
  TF_FAULT_POINT("plan.publishing");
  TF_ASSIGN_OR_RETURN(const std::string name, server_->Publish(bytes, TitleOfSeries(series->key)));
  TF_FAULT_POINT("plan.published");
  if (name != series->case_name) {
    return absl::DataLossError("the server's name of the case does not match its bytes");
  }
  series->state = SeriesState::kPublished;
  series->done_s = std::time(nullptr);
  return absl::OkStatus();
}

}  // namespace tissueform
