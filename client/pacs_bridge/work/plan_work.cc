// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/plan_work.h"

#include <chrono>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <system_error>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "client/pacs_bridge/work/tissueform_command.h"
#include "core/base/atomic_folder.h"
#include "core/base/backoff.h"
#include "core/base/error_reason.h"
#include "core/base/parallel_for.h"
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
constexpr size_t kMaxErrorBytes = 512;
constexpr size_t kCaseTitleDigits = 8;
constexpr char kCases[] = "cases/";

// The images of one series as the only ones of a folder, whatever else lies beside them.
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

absl::StatusOr<std::string> ReadCaseFile(const std::string& path) {
  std::string bytes;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&bytes](absl::string_view piece) {
    if (bytes.size() + piece.size() > kMaxCaseBytes) {
      return absl::ResourceExhaustedError("a case is larger than the limit");
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
  return step == SeriesState::kPacked && IsTransient(status);
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

absl::Status PlanWork::Build(QueuedSeries* series) {
  const std::string folder = queue_->plan_folder(series->key);
  const std::string plan = queue_->plan_path(series->key);
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::error_code ignored;
  if (!fs::exists(plan + "/plan.json", ignored)) {
    TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows_.ListImages(series->key));
    const std::string ct = folder + "/ct";
    const absl::Cleanup remove_links = [&ct] {
      std::error_code failed;
      fs::remove_all(ct, failed);
    };
    TF_RETURN_IF_ERROR(LinkImages(images, ct));
    TF_FAULT_POINT("plan.linked");
    TF_ASSIGN_OR_RETURN(AtomicFolder goal, AtomicFolder::Create(plan));
    PlanBuildCallOptions calling;
    if (options_.tell) {
      calling.tell = [&](absl::string_view stage, double fraction) {
        options_.tell(series->key, stage, fraction);
      };
    }
    calling.cancel = options_.cancel;
    TF_ASSIGN_OR_RETURN(
        const PlanBuildAnswer made,
        CallPlanBuild({.ct = ct,
                       .recipe = series->recipe,
                       .folder = goal.path(),
                       .folder_name = "plan",
                       .threads = options_.threads > 0 ? options_.threads : AvailableProcessors(),
                       .pictures = options_.pictures,
                       .limits = {.max_memory_bytes = options_.max_memory_bytes,
                                  .max_seconds = options_.max_seconds,
                                  .max_file_bytes = int64_t{4} << 30}},
                      calling));
    if (!made.ready && !options_.accept_defects) {
      return absl::FailedPreconditionError(absl::StrCat("the plan is not ready: ", made.defects));
    }
    TF_RETURN_IF_ERROR(goal.Publish());
  }
  TF_FAULT_POINT("plan.built");
  series->state = SeriesState::kBuilt;
  return absl::OkStatus();
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
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadCaseFile(fresh));
  series->case_name = absl::StrCat(kCases, Sha256Hex({bytes}));
  TF_RETURN_IF_ERROR(RenameDurably(fresh, CasePathOf(*queue_, series->key, series->case_name)));
  series->state = SeriesState::kPacked;
  return absl::OkStatus();
}

absl::Status PlanWork::Publish(QueuedSeries* series) {
  if (server_ == nullptr) {
    return absl::FailedPreconditionError("no server to publish to; give --server HOST:PORT");
  }
  TF_ASSIGN_OR_RETURN(const std::string bytes,
                      ReadCaseFile(CasePathOf(*queue_, series->key, series->case_name)));
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
