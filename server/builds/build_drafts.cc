// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/build_drafts.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "proto/conversion/plan_build_conversion.h"
#include "server/builds/rising_id.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/store_records.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kSecondsPerHour = 3600;
constexpr int64_t kCasesKeptS = 30 * 24 * kSecondsPerHour;

absl::StatusOr<store::v1::BuildDraftRecord> ReadDraft(const std::string& path) {
  std::string bytes;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&bytes](absl::string_view piece) {
    absl::StrAppend(&bytes, piece);
    return absl::OkStatus();
  }));
  TF_ASSIGN_OR_RETURN(const absl::string_view sealed, Unseal(bytes));
  store::v1::BuildDraftRecord record;
  if (!record.ParseFromArray(sealed.data(), static_cast<int>(sealed.size()))) {
    return absl::DataLossError("the record of a draft is unreadable");
  }
  return record;
}

bool IsOf(const v1::BuildDraft& draft, const std::string& owner,
          const v1::CreateBuildDraftRequest& request) {
  return draft.principal() == owner && draft.ct() == request.ct() &&
         draft.title() == request.title() && draft.project() == request.project() &&
         draft.recipe_json() == request.recipe_json() && draft.cases().empty();
}

}  // namespace

absl::Status NoBuildDraft(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no draft ", id, " (any more); list the drafts again"));
}

BuildDrafts::BuildDrafts(std::string folder, const PlanBuildLimits& limits, BuildFiles* files,
                         UnixClock clock)
    : folder_(std::move(folder)), limits_(limits), files_(files), clock_(std::move(clock)) {}

absl::StatusOr<std::unique_ptr<BuildDrafts>> BuildDrafts::Open(std::string folder,
                                                               const PlanBuildLimits& limits,
                                                               BuildFiles* files, UnixClock clock) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::unique_ptr<BuildDrafts> drafts(
      new BuildDrafts(std::move(folder), limits, files, std::move(clock)));
  TF_RETURN_IF_ERROR(drafts->TakeUp());
  return drafts;
}

// What cannot be read is no draft: damage must not open another's CT.
absl::Status BuildDrafts::TakeUp() {
  std::error_code error;
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder_, error)) found.push_back(entry.path());
  if (error) return FileError(error.value(), "cannot read", folder_);
  MutexLock lock(mutex_);
  for (const fs::path& path : found) {
    const auto record = ReadDraft(path.string());
    const std::string id = path.filename().string();
    if (!record.ok() || record->draft().name() != BuildDraftName(id)) {
      fs::remove(path, error);
      continue;
    }
    drafts_[id] = {.proto = record->draft(), .built_s = record->built_s()};
  }
  return absl::OkStatus();
}

std::string BuildDrafts::PathOf(const std::string& id) const {
  return absl::StrCat(folder_, "/", id);
}

absl::Status BuildDrafts::Keep(const std::string& id, const Draft& draft) const {
  store::v1::BuildDraftRecord record;
  *record.mutable_draft() = draft.proto;
  record.set_built_s(draft.built_s);
  return WriteDurably(PathOf(id), {Seal(record.SerializeAsString())});
}

std::string BuildDrafts::NewId() const {
  return RisingId(clock_(), drafts_.empty() ? "" : drafts_.rbegin()->first);
}

int64_t BuildDrafts::ExpiresS(const Draft& draft) const {
  return draft.built_s > 0
             ? draft.built_s + limits_.retention_hours * kSecondsPerHour
             : draft.proto.create_time().seconds() + limits_.draft_hours * kSecondsPerHour;
}

v1::BuildDraft BuildDrafts::Shown(const Draft& draft) const {
  v1::BuildDraft shown = draft.proto;
  shown.mutable_expire_time()->set_seconds(ExpiresS(draft));
  return shown;
}

absl::StatusOr<v1::BuildDraft> BuildDrafts::Create(const std::string& owner,
                                                   const v1::CreateBuildDraftRequest& request) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseBuildFileName(request.ct()));
  TF_ASSIGN_OR_RETURN(const BuildFileRecord file, files_->Ask(owner, sha256));
  TF_RETURN_IF_ERROR(CheckWhole(file));
  MutexLock lock(mutex_);
  int of_owner = 0;
  for (const auto& [id, draft] : drafts_) {
    if (IsOf(draft.proto, owner, request)) return Shown(draft);
    of_owner += draft.proto.principal() == owner && draft.built_s == 0 ? 1 : 0;
  }
  if (of_owner >= limits_.max_drafts_of_principal) {
    return absl::ResourceExhaustedError(
        absl::StrCat(of_owner,
                     " of your drafts wait, which is the limit (--quota-drafts); remove "
                     "some"));
  }
  const std::string id = NewId();
  Draft draft;
  draft.proto.set_name(BuildDraftName(id));
  draft.proto.set_title(request.title());
  draft.proto.set_project(request.project());
  draft.proto.set_recipe_json(request.recipe_json());
  draft.proto.set_ct(request.ct());
  draft.proto.set_suffix(file.suffix);
  draft.proto.set_total_bytes(file.total_bytes);
  draft.proto.set_principal(owner);
  draft.proto.mutable_create_time()->set_seconds(clock_());
  TF_RETURN_IF_ERROR(Keep(id, draft));
  return Shown(drafts_[id] = std::move(draft));
}

absl::StatusOr<v1::BuildDraft> BuildDrafts::Find(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = drafts_.find(id);
  if (found == drafts_.end()) return NoBuildDraft(id);
  return Shown(found->second);
}

std::vector<v1::BuildDraft> BuildDrafts::List() const {
  MutexLock lock(mutex_);
  std::vector<v1::BuildDraft> all;
  all.reserve(drafts_.size());
  for (const auto& [id, draft] : drafts_) all.push_back(Shown(draft));
  return all;
}

absl::Status BuildDrafts::AddCase(const std::string& id, const std::string& case_name) {
  MutexLock lock(mutex_);
  const auto found = drafts_.find(id);
  if (found == drafts_.end()) return NoBuildDraft(id);
  Draft changed = found->second;
  changed.built_s = clock_();
  const auto& cases = changed.proto.cases();
  if (std::find(cases.begin(), cases.end(), case_name) == cases.end()) {
    changed.proto.add_cases(case_name);
  }
  TF_RETURN_IF_ERROR(Keep(id, changed));
  found->second = std::move(changed);
  return absl::OkStatus();
}

absl::Status BuildDrafts::Remove(const std::string& id) {
  MutexLock lock(mutex_);
  if (!drafts_.contains(id)) return NoBuildDraft(id);
  TF_RETURN_IF_ERROR(RemoveFile(PathOf(id)));
  drafts_.erase(id);
  return SyncFolder(folder_);
}

bool BuildDrafts::IsNeeded(const std::string& owner, const std::string& sha256) const {
  MutexLock lock(mutex_);
  return std::any_of(drafts_.begin(), drafts_.end(), [&](const auto& entry) {
    const Draft& draft = entry.second;
    return draft.proto.principal() == owner && draft.proto.ct() == BuildFileName(sha256) &&
           ExpiresS(draft) > clock_();
  });
}

void BuildDrafts::RemoveExpired(const std::function<bool(const std::string& name)>& is_used) {
  for (const v1::BuildDraft& draft : List()) {
    const int64_t kept_s =
        draft.expire_time().seconds() + (draft.cases().empty() ? 0 : kCasesKeptS);
    if (kept_s > clock_() || is_used(draft.name())) continue;
    const absl::StatusOr<std::string> id = ParseBuildDraftName(draft.name());
    const absl::Status removed = id.ok() ? Remove(*id) : id.status();
    if (!removed.ok()) {
      spdlog::warn("a draft whose time is over cannot be removed: {}",
                   std::string(removed.message()));
    }
  }
}

}  // namespace tissueform
