// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/plan_builds.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"
#include <sys/eventfd.h>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/plan_build_conversion.h"
#include "server/builds/rising_id.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/store_records.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr char kBuilds[] = "planBuilds/";
constexpr char kCases[] = "cases/";
constexpr char kRecord[] = "/record";
constexpr char kResult[] = "/plan";
constexpr char kWork[] = "/work";
constexpr int64_t kSecondsPerHour = 3600;
constexpr int64_t kSecondsPerDay = 24 * kSecondsPerHour;
constexpr size_t kMaxDetailBytes = 1024;
// How often builds and files are looked for whose time is over.
constexpr std::chrono::minutes kSweepPeriod{10};

bool IsDone(v1::PlanBuildState state) {
  return state != v1::PLAN_BUILD_STATE_WAITING && state != v1::PLAN_BUILD_STATE_RUNNING;
}

absl::Status NoBuild(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no plan build ", id, " (any more)"));
}

std::string FingerprintOf(const v1::CreatePlanBuildRequest& request) {
  return Sha256Hex({request.SerializeAsString()});
}

// Names of files in the request, each once or more.
std::vector<std::string> FilesOf(const v1::CreatePlanBuildRequest& request) {
  std::vector<std::string> names = {request.ct(), request.labels(), request.surfaces()};
  for (const v1::RecipeFile& file : request.recipe_files()) names.push_back(file.file());
  std::vector<std::string> sha256s;
  for (const std::string& name : names) {
    if (!name.empty()) sha256s.push_back(name.substr(name.rfind('/') + 1));
  }
  return sha256s;
}

absl::StatusOr<store::v1::PlanBuildRecord> ReadRecord(const std::string& path) {
  std::string bytes;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&bytes](absl::string_view piece) {
    absl::StrAppend(&bytes, piece);
    return absl::OkStatus();
  }));
  TF_ASSIGN_OR_RETURN(const absl::string_view sealed, Unseal(bytes));
  store::v1::PlanBuildRecord record;
  if (!record.ParseFromArray(sealed.data(), static_cast<int>(sealed.size()))) {
    return absl::DataLossError("the record of a plan build is unreadable");
  }
  return record;
}

// Longer ones are cut between characters.
std::string Detail(const absl::Status& status) {
  std::string detail(status.message().substr(0, kMaxDetailBytes));
  while (detail.size() == kMaxDetailBytes && (detail.back() & 0xC0) == 0x80) detail.pop_back();
  return detail;
}

}  // namespace

struct PlanBuilds::Build {
  Build() : cancel(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~Build() { close(cancel); }
  Build(const Build&) = delete;
  Build& operator=(const Build&) = delete;

  void AskToEnd() const { eventfd_write(cancel, 1); }

  const int cancel;  // readable: it is to end
  // Of the mutex.
  store::v1::PlanBuildRecord record;
  std::string id;
  std::string owner;
  bool is_cancelled = false;           // its owner wants its end
  std::vector<BuildFileRecord> files;  // as they were when it was created
};

PlanBuilds::PlanBuilds(std::string folder, const PlanBuildLimits& limits, int threads,
                       BuildFiles* files, BuildDrafts* drafts, Work work, UnixClock clock)
    : folder_(std::move(folder)),
      limits_(limits),
      threads_(threads),
      files_(files),
      drafts_(drafts),
      work_(std::move(work)),
      clock_(std::move(clock)) {}

absl::StatusOr<std::unique_ptr<PlanBuilds>> PlanBuilds::Open(std::string folder,
                                                             const PlanBuildLimits& limits,
                                                             int threads, BuildFiles* files,
                                                             BuildDrafts* drafts, Work work,
                                                             UnixClock clock) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::unique_ptr<PlanBuilds> builds(new PlanBuilds(std::move(folder), limits, threads, files,
                                                    drafts, std::move(work), std::move(clock)));
  TF_RETURN_IF_ERROR(builds->TakeUp());
  for (int i = 0; i < limits.at_once; ++i) {
    builds->workers_.emplace_back([raw = builds.get()] { raw->Serve(); });
  }
  return builds;
}

PlanBuilds::~PlanBuilds() {
  {
    MutexLock lock(mutex_);
    is_ending_ = true;
    for (const auto& [id, build] : builds_) build->AskToEnd();
    changed_.NotifyAll();
  }
  for (std::thread& worker : workers_) worker.join();
}

absl::Status PlanBuilds::TakeUp() {
  std::error_code error;
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder_, error)) found.push_back(entry.path());
  if (error) return FileError(error.value(), "cannot read", folder_);
  MutexLock lock(mutex_);
  for (const fs::path& path : found) {
    auto record = ReadRecord(path.string() + kRecord);
    // A build without a record was not yet kept, and no client knows of it.
    if (!record.ok()) {
      if (fs::exists(path.string() + kRecord, error)) {
        spdlog::warn("a plan build with an unreadable record is removed: {}",
                     std::string(record.status().message()));
      }
      fs::remove_all(path, error);
      continue;
    }
    auto build = std::make_shared<Build>();
    build->record = *std::move(record);
    build->id = path.filename().string();
    build->owner = build->record.build().principal();
    fs::remove_all(path.string() + kWork, error);
    for (const std::string& sha256 : FilesOf(build->record.request())) {
      if (auto file = files_->Find(build->owner, sha256); file.ok()) {
        build->files.push_back(*std::move(file));
      }
    }
    if (build->record.build().state() == v1::PLAN_BUILD_STATE_RUNNING) {
      fs::remove_all(path.string() + kResult, error);
      v1::PlanBuild& proto = *build->record.mutable_build();
      proto.set_state(v1::PLAN_BUILD_STATE_FAILED);
      proto.set_detail("the server ended while the plan was built; build it again");
      proto.mutable_update_time()->set_seconds(clock_());
      TF_RETURN_IF_ERROR(Keep(*build));
    }
    builds_[build->id] = std::move(build);
  }
  return absl::OkStatus();
}

std::string PlanBuilds::FolderOf(const std::string& id) const {
  return absl::StrCat(folder_, "/", id);
}

absl::Status PlanBuilds::Keep(const Build& build) const {
  return WriteDurably(FolderOf(build.id) + kRecord, {Seal(build.record.SerializeAsString())});
}

int PlanBuilds::CountRemovedToday(const std::string& owner) {
  const int64_t day_begin_s = clock_() - kSecondsPerDay;
  removed_.erase(
      std::remove_if(removed_.begin(), removed_.end(),
                     [&](const Removed& build) { return build.create_s <= day_begin_s; }),
      removed_.end());
  return static_cast<int>(
      std::count_if(removed_.begin(), removed_.end(),
                    [&owner](const Removed& build) { return build.owner == owner; }));
}

absl::Status PlanBuilds::CheckRoom(const std::string& owner) {
  int waiting = 0;
  int of_owner = 0;
  int of_today = CountRemovedToday(owner);
  for (const auto& [id, build] : builds_) {
    const v1::PlanBuild& proto = build->record.build();
    const bool is_open = !IsDone(proto.state());
    waiting += is_open ? 1 : 0;
    if (build->owner != owner) continue;
    of_owner += is_open ? 1 : 0;
    of_today += proto.create_time().seconds() > clock_() - kSecondsPerDay ? 1 : 0;
  }
  if (waiting >= limits_.max_waiting) {
    return absl::ResourceExhaustedError(absl::StrCat(
        waiting,
        " plans are being built or wait, which is the limit (--max-plan-builds); try again "
        "in a few minutes"));
  }
  if (of_owner >= limits_.max_waiting_of_principal) {
    return absl::ResourceExhaustedError(
        absl::StrCat(of_owner,
                     " of your plans are being built or wait, which is the limit "
                     "(--quota-plan-builds); wait for one, or cancel one"));
  }
  if (of_today >= limits_.max_per_day) {
    return absl::ResourceExhaustedError(
        absl::StrCat("you have built ", of_today,
                     " plans in 24 hours, which is the limit "
                     "(--quota-plan-builds-per-day); try tomorrow"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<BuildFileRecord>> PlanBuilds::CheckFiles(
    const std::string& owner, const v1::CreatePlanBuildRequest& request) const {
  std::vector<BuildFileRecord> files;
  for (const std::string& sha256 : FilesOf(request)) {
    TF_ASSIGN_OR_RETURN(const BuildFileRecord file, files_->Find(owner, sha256));
    TF_ASSIGN_OR_RETURN(const BuildFileRecord whole, files_->Commit(file));
    TF_RETURN_IF_ERROR(CheckWhole(whole));
    files.push_back(whole);
  }
  return files;
}

absl::StatusOr<v1::PlanBuild> PlanBuilds::Create(const std::string& owner,
                                                 const v1::CreatePlanBuildRequest& request) {
  TF_ASSIGN_OR_RETURN(std::vector<BuildFileRecord> files, CheckFiles(owner, request));
  const std::string fingerprint = FingerprintOf(request);
  MutexLock lock(mutex_);
  for (const auto& [id, build] : builds_) {
    if (request.request_id().empty() || build->owner != owner) continue;
    if (build->record.request().request_id() != request.request_id()) continue;
    if (build->record.request_fingerprint() == fingerprint) return Shown(*build);
    return WithReason(
        absl::InvalidArgumentError("request_id was used for another build; choose a new one"),
        ErrorReason::kRequestIdReused);
  }
  TF_RETURN_IF_ERROR(CheckRoom(owner));
  auto build = std::make_shared<Build>();
  build->id = RisingId(clock_(), builds_.empty() ? "" : builds_.rbegin()->first);
  build->owner = owner;
  build->files = std::move(files);
  *build->record.mutable_request() = request;
  build->record.set_request_fingerprint(fingerprint);
  v1::PlanBuild& proto = *build->record.mutable_build();
  proto.set_name(kBuilds + build->id);
  proto.set_state(v1::PLAN_BUILD_STATE_WAITING);
  proto.set_title(request.title());
  proto.set_principal(owner);
  proto.mutable_create_time()->set_seconds(clock_());
  *proto.mutable_update_time() = proto.create_time();
  TF_RETURN_IF_ERROR(MakeFolder(FolderOf(build->id)));
  TF_RETURN_IF_ERROR(Keep(*build));
  TF_RETURN_IF_ERROR(SyncFolder(folder_));
  builds_[build->id] = build;
  changed_.NotifyAll();
  return Shown(*build);
}

absl::StatusOr<PlanBuilds::BuildPtr> PlanBuilds::Known(const std::string& owner,
                                                       const std::string& id) const {
  const auto found = builds_.find(id);
  if (found == builds_.end() || found->second->owner != owner) return NoBuild(id);
  return found->second;
}

v1::PlanBuild PlanBuilds::Shown(const Build& build) const {
  v1::PlanBuild shown = build.record.build();
  if (shown.state() == v1::PLAN_BUILD_STATE_WAITING) {
    shown.set_builds_before(static_cast<int32_t>(
        std::count_if(builds_.begin(), builds_.end(), [&build](const auto& entry) {
          return entry.first < build.id && !IsDone(entry.second->record.build().state());
        })));
  }
  if (IsDone(shown.state())) {
    shown.mutable_expire_time()->set_seconds(shown.update_time().seconds() +
                                             limits_.retention_hours * kSecondsPerHour);
  }
  return shown;
}

absl::StatusOr<v1::PlanBuild> PlanBuilds::Find(const std::string& owner,
                                               const std::string& id) const {
  MutexLock lock(mutex_);
  TF_ASSIGN_OR_RETURN(const BuildPtr build, Known(owner, id));
  return Shown(*build);
}

PlanBuilds::Page PlanBuilds::List(const std::string& owner, const std::string& after,
                                  int limit) const {
  MutexLock lock(mutex_);
  Page page;
  for (auto at = builds_.upper_bound(after); at != builds_.end(); ++at) {
    if (at->second->owner != owner) continue;
    if (page.builds.size() == static_cast<size_t>(limit)) {
      page.next = page.builds.back().name().substr(sizeof(kBuilds) - 1);
      break;
    }
    page.builds.push_back(Shown(*at->second));
  }
  return page;
}

absl::StatusOr<v1::PlanBuild> PlanBuilds::Cancel(const std::string& owner, const std::string& id) {
  BuildPtr ended;
  v1::PlanBuild shown;
  {
    MutexLock lock(mutex_);
    TF_ASSIGN_OR_RETURN(const BuildPtr build, Known(owner, id));
    v1::PlanBuild& proto = *build->record.mutable_build();
    if (proto.state() == v1::PLAN_BUILD_STATE_RUNNING) {
      build->is_cancelled = true;
      build->AskToEnd();
    }
    if (proto.state() == v1::PLAN_BUILD_STATE_WAITING) {
      proto.set_state(v1::PLAN_BUILD_STATE_CANCELLED);
      proto.mutable_update_time()->set_seconds(clock_());
      TF_RETURN_IF_ERROR(Keep(*build));
      ended = build;
    }
    shown = Shown(*build);
  }
  if (ended != nullptr) DropFiles(*ended);
  return shown;
}

absl::Status PlanBuilds::RemoveBuild(const BuildPtr& build) {
  // The record first: a folder without one goes at the next start.
  TF_RETURN_IF_ERROR(RemoveFile(FolderOf(build->id) + kRecord));
  removed_.push_back({build->owner, build->record.build().create_time().seconds()});
  builds_.erase(build->id);
  std::error_code ignored;
  fs::remove_all(FolderOf(build->id), ignored);
  return absl::OkStatus();
}

absl::Status PlanBuilds::Remove(const std::string& owner, const std::string& id) {
  MutexLock lock(mutex_);
  TF_ASSIGN_OR_RETURN(const BuildPtr build, Known(owner, id));
  if (!IsDone(build->record.build().state())) {
    return absl::FailedPreconditionError("the plan is still being built; cancel the build first");
  }
  return RemoveBuild(build);
}

absl::StatusOr<std::string> PlanBuilds::PathOf(const std::string& owner, const std::string& id,
                                               const std::string& path) const {
  MutexLock lock(mutex_);
  TF_ASSIGN_OR_RETURN(const BuildPtr build, Known(owner, id));
  for (const v1::PlanBuildFile& file : build->record.build().files()) {
    if (file.path() == path) return absl::StrCat(FolderOf(id), kResult, "/", path);
  }
  return absl::NotFoundError(
      absl::StrCat("plan build ", id, " has no such file; PlanBuild.files names them"));
}

int PlanBuilds::CountOpen() const {
  MutexLock lock(mutex_);
  return static_cast<int>(std::count_if(builds_.begin(), builds_.end(), [](const auto& entry) {
    return !IsDone(entry.second->record.build().state());
  }));
}

bool PlanBuilds::IsDraftUsed(const std::string& draft) const {
  MutexLock lock(mutex_);
  return std::any_of(builds_.begin(), builds_.end(), [&draft](const auto& entry) {
    const store::v1::PlanBuildRecord& record = entry.second->record;
    return record.request().draft() == draft && !IsDone(record.build().state());
  });
}

absl::Status PlanBuilds::RemoveDraft(const v1::BuildDraft& draft) {
  if (IsDraftUsed(draft.name())) {
    return absl::FailedPreconditionError(
        "a plan is being built of this draft; cancel the build first, or wait for it");
  }
  TF_ASSIGN_OR_RETURN(const std::string id, ParseBuildDraftName(draft.name()));
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseBuildFileName(draft.ct()));
  const absl::StatusOr<BuildFileRecord> file = files_->Find(draft.principal(), sha256);
  TF_RETURN_IF_ERROR(drafts_->Remove(id));
  if (file.ok() && !IsNeeded(file->owner, sha256)) files_->RemoveIfUnasked(*file);
  return absl::OkStatus();
}

bool PlanBuilds::IsNeeded(const std::string& owner, const std::string& sha256) const {
  if (drafts_->IsNeeded(owner, sha256)) return true;
  MutexLock lock(mutex_);
  return std::any_of(builds_.begin(), builds_.end(), [&](const auto& entry) {
    const Build& build = *entry.second;
    if (build.owner != owner || IsDone(build.record.build().state())) return false;
    const std::vector<std::string> files = FilesOf(build.record.request());
    return std::find(files.begin(), files.end(), sha256) != files.end();
  });
}

void PlanBuilds::RemoveExpired() {
  {
    MutexLock lock(mutex_);
    std::vector<BuildPtr> old;
    for (const auto& [id, build] : builds_) {
      const v1::PlanBuild& proto = build->record.build();
      const int64_t end_s =
          proto.update_time().seconds() + limits_.retention_hours * kSecondsPerHour;
      if (IsDone(proto.state()) && end_s <= clock_()) old.push_back(build);
    }
    for (const BuildPtr& build : old) {
      if (const absl::Status removed = RemoveBuild(build); !removed.ok()) {
        spdlog::warn("a plan build whose time is over cannot be removed: {}",
                     std::string(removed.message()));
      }
    }
  }
  drafts_->RemoveExpired([this](const std::string& draft) { return IsDraftUsed(draft); });
  files_->RemoveExpired([this](const std::string& owner, const std::string& sha256) {
    return IsNeeded(owner, sha256);
  });
}

PlanBuilds::BuildPtr PlanBuilds::NextWaiting() const {
  for (const auto& [id, build] : builds_) {
    if (build->record.build().state() == v1::PLAN_BUILD_STATE_WAITING) return build;
  }
  return nullptr;
}

void PlanBuilds::Serve() {
  auto next_sweep = std::chrono::steady_clock::now();
  while (true) {
    BuildPtr build;
    {
      MutexLock lock(mutex_);
      while (!is_ending_ && (build = NextWaiting()) == nullptr &&
             std::chrono::steady_clock::now() < next_sweep) {
        changed_.WaitUntil(mutex_, next_sweep);
      }
      if (is_ending_) return;
      if (build != nullptr) {
        build->record.mutable_build()->set_state(v1::PLAN_BUILD_STATE_RUNNING);
        build->record.mutable_build()->mutable_update_time()->set_seconds(clock_());
        if (const absl::Status kept = Keep(*build); !kept.ok()) {
          spdlog::warn("a plan build cannot be noted as running: {}", std::string(kept.message()));
        }
      }
    }
    if (build != nullptr) Run(build);
    if (std::chrono::steady_clock::now() >= next_sweep) {
      RemoveExpired();
      next_sweep = std::chrono::steady_clock::now() + kSweepPeriod;
    }
  }
}

void PlanBuilds::Run(const BuildPtr& build) {
  v1::CreatePlanBuildRequest request;
  {
    MutexLock lock(mutex_);
    request = build->record.request();
  }
  PlanBuildJob job{.id = build->id,
                   .owner = build->owner,
                   .request = std::move(request),
                   .work_folder = FolderOf(build->id) + kWork,
                   .result_folder = FolderOf(build->id) + kResult,
                   .threads = threads_,
                   .cancel = build->cancel,
                   .on_stage = [this, build](absl::string_view stage, double fraction) {
                     MutexLock lock(mutex_);
                     build->record.mutable_build()->set_stage(std::string(stage));
                     build->record.mutable_build()->set_fraction(fraction);
                   }};
  const absl::Status made = MakeFolder(job.work_folder);
  const absl::StatusOr<BuiltPlan> plan = made.ok() ? work_(job) : made;
  std::error_code ignored;
  fs::remove_all(job.work_folder, ignored);
  if (!plan.ok()) fs::remove_all(job.result_folder, ignored);
  Finish(build, plan);
}

// Before the build counts as done: then the creator of the draft finds its case.
void PlanBuilds::NoteCase(const std::string& draft, const std::string& case_sha256) {
  const absl::StatusOr<std::string> id = ParseBuildDraftName(draft);
  if (!id.ok()) return;  // of no draft
  if (const absl::Status noted = drafts_->AddCase(*id, kCases + case_sha256); !noted.ok()) {
    spdlog::warn("the case of a draft cannot be noted: {}", std::string(noted.message()));
  }
}

void PlanBuilds::Finish(const BuildPtr& build, const absl::StatusOr<BuiltPlan>& plan) {
  if (plan.ok()) NoteCase(build->record.request().draft(), plan->case_sha256);
  {
    MutexLock lock(mutex_);
    // As it was kept: the next start says that it has failed.
    if (is_ending_ && !plan.ok()) return;
    v1::PlanBuild& proto = *build->record.mutable_build();
    proto.clear_stage();
    proto.set_fraction(plan.ok() ? 1 : 0);
    proto.mutable_update_time()->set_seconds(clock_());
    if (plan.ok()) {
      proto.set_state(v1::PLAN_BUILD_STATE_SUCCEEDED);
      proto.set_case_(kCases + plan->case_sha256);
      proto.set_is_ready(plan->is_ready);
      proto.set_defects(plan->defects);
      proto.set_summary(plan->summary);
      for (v1::PlanBuildFile& file : ListPlanBuildFiles(FolderOf(build->id) + kResult)) {
        *proto.add_files() = std::move(file);
      }
    } else if (build->is_cancelled) {
      proto.set_state(v1::PLAN_BUILD_STATE_CANCELLED);
    } else {
      proto.set_state(v1::PLAN_BUILD_STATE_FAILED);
      proto.set_detail(Detail(plan.status()));
    }
    if (const absl::Status kept = Keep(*build); !kept.ok()) {
      spdlog::warn("the end of a plan build cannot be kept: {}", std::string(kept.message()));
    }
    changed_.NotifyAll();
  }
  DropFiles(*build);
}

// What no other build needs, unless its owner keeps it.
void PlanBuilds::DropFiles(const Build& build) {
  std::vector<BuildFileRecord> files;
  {
    MutexLock lock(mutex_);
    if (build.record.request().keep_files()) return;
    files = build.files;
  }
  for (const BuildFileRecord& file : files) {
    if (!IsNeeded(file.owner, file.sha256)) files_->RemoveIfUnasked(file);
  }
}

}  // namespace tissueform
