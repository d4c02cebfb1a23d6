// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_runs.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <memory>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <sys/file.h>

#include "client/cli/outcome/cohort_record.h"
#include "client/cli/shared/companion.h"
#include "core/base/mutex.h"
#include "core/base/parallel_for.h"
#include "core/base/process/guarded_program.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerGib = int64_t{1} << 30;
constexpr double kGibOfAJob = 4;  // by default: a CT of 512 x 512 x 250 needs less
constexpr double kLeastGibOfAJob = 1;
constexpr std::chrono::seconds kEndGrace{5};
constexpr absl::string_view kErrorPrefix = "tissueform: ";

// One process at a time works in a folder; the system releases the lock when that ends.
class FolderLock {
 public:
  static absl::StatusOr<FolderLock> Take(const std::string& folder) {
    FolderLock lock(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock.descriptor_ >= 0 && flock(lock.descriptor_, LOCK_EX | LOCK_NB) == 0) return lock;
    if (errno != EWOULDBLOCK) return absl::ErrnoToStatus(errno, "cannot lock the output folder");
    return absl::FailedPreconditionError(
        "another `tissueform outcome cohort` works in the output folder; wait until it ends");
  }
  ~FolderLock() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  FolderLock(FolderLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FolderLock& operator=(FolderLock&&) = delete;

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

absl::Status MakeFolders(const std::string& out) {
  std::error_code error;
  const bool is_cohort = fs::is_directory(CasesFolder(out), error);
  if (fs::exists(out, error) && !fs::is_directory(out, error)) {
    return absl::AlreadyExistsError(absl::StrCat("--out ", out, " is a file; name a new folder"));
  }
  if (!is_cohort && fs::exists(out, error) && !fs::is_empty(out, error)) {
    return absl::AlreadyExistsError(
        absl::StrCat("--out ", out,
                     " has files that are not a cohort's; name a new folder, or that of an "
                     "earlier `tissueform outcome cohort`"));
  }
  if (!is_cohort) fs::create_directory(out, error);
  if (!is_cohort && !error) fs::create_directory(CasesFolder(out), error);
  if (fs::is_directory(CasesFolder(out), error)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("cannot make folder ", out, ": its parent is missing or not writable"));
}

// How many processes, and what each may use.
struct JobPlan {
  int jobs = 1;
  int threads = 1;
  int64_t memory_bytes = 0;
};

double MemoryGibOfMachine() {
  const auto bytes =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  return bytes / kBytesPerGib;
}

absl::StatusOr<JobPlan> PlanJobs(const CohortOptions& options) {
  const double gib = options.memory_gib > 0 ? options.memory_gib : 0.75 * MemoryGibOfMachine();
  const int processors = AvailableProcessors();
  JobPlan plan;
  plan.jobs = options.jobs;
  if (plan.jobs == 0) plan.jobs = std::clamp(static_cast<int>(gib / kGibOfAJob), 1, processors);
  plan.threads = std::max(1, processors / plan.jobs);
  if (gib / plan.jobs < kLeastGibOfAJob) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%.1f GiB for %d processes are less than %.0f GiB for each; give fewer --jobs or more "
        "--memory-gib",
        gib, plan.jobs, kLeastGibOfAJob));
  }
  plan.memory_bytes = static_cast<int64_t>(gib / plan.jobs * kBytesPerGib);
  return plan;
}

std::vector<std::string> OptionsOfOutcome(const CohortOptions& options) {
  std::vector<std::string> words;
  for (const std::string& model : options.models) {
    words.insert(words.end(), {"--model", model});
  }
  if (options.accept_findings) words.emplace_back("--accept-findings");
  if (options.calibrate) words.emplace_back("--calibrate");
  if (options.no_pictures) words.emplace_back("--no-pictures");
  return words;
}

std::string RecordPath(const std::string& out, const std::string& id) {
  return CaseFolder(out, id) + ".json";
}

std::string ErrorsPath(const std::string& out, const std::string& id) {
  return absl::StrCat(CasesFolder(out), "/.", id, ".errors");
}

// An old result, and what a killed run left.
void RemoveResult(const std::string& out, const std::string& id) {
  std::error_code error;
  std::vector<fs::path> gone = {CaseFolder(out, id), RecordPath(out, id), ErrorsPath(out, id)};
  for (const auto& entry : fs::directory_iterator(CasesFolder(out), error)) {
    const bool is_left =
        absl::StartsWith(entry.path().filename().string(), absl::StrCat(".", id, ".partial-"));
    if (is_left) gone.push_back(entry.path());
  }
  for (const fs::path& path : gone) fs::remove_all(path, error);
}

// The last error line that a child wrote.
std::string LastError(const std::string& path) {
  std::ifstream file(path);
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (absl::StartsWith(line, kErrorPrefix)) last = line.substr(kErrorPrefix.size());
  }
  return last;
}

class CohortRunner {
 public:
  CohortRunner(const std::vector<CohortCase>& cases, const CohortOptions& options,
               const JobPlan& plan)
      : cases_(cases),
        options_(options),
        plan_(plan),
        words_(OptionsOfOutcome(options)),
        runs_(cases.size()) {}

  std::vector<CohortRun> Run() {
    FindWork();
    std::vector<std::thread> workers;
    const size_t count = std::min(work_.size(), static_cast<size_t>(plan_.jobs));
    workers.reserve(count);
    for (size_t w = 0; w < count; ++w) workers.emplace_back([this] { WorkUntilDone(); });
    for (std::thread& worker : workers) worker.join();
    return std::move(runs_);
  }

 private:
  void FindWork() {
    for (size_t c = 0; c < cases_.size(); ++c) {
      const std::string& id = cases_[c].id;
      records_.push_back(RecordOf(cases_[c], words_));
      const bool has_result = fs::exists(CaseFolder(options_.out, id) + "/outcome.json");
      const std::string reason = ReasonToRepeat(RecordPath(options_.out, id), records_.back());
      runs_[c].kept = has_result && reason.empty();
      if (runs_[c].kept) continue;
      work_.push_back(c);
      if (has_result) absl::PrintF("%s runs again: %s\n", id, reason);
    }
    absl::PrintF("%d cases: %d finished before, %d to run, %d at a time\n", cases_.size(),
                 cases_.size() - work_.size(), work_.size(), plan_.jobs);
    std::fflush(stdout);
  }

  void WorkUntilDone() ABSL_LOCKS_EXCLUDED(mutex_) {
    for (size_t c = 0; Take(&c);) {
      const std::string refusal = RunCase(c);
      MutexLock lock(mutex_);
      runs_[c].refusal = refusal;
      ++done_;
      absl::FPrintF(stderr, "[%3d %% %7.1f s] %s %s; %d left\n", 100 * done_ / work_.size(),
                    stopwatch_.Seconds(), cases_[c].id,
                    refusal.empty() ? "done" : absl::StrCat("failed: ", refusal),
                    work_.size() - done_);
    }
  }

  bool Take(size_t* c) ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    if (next_ == work_.size()) return false;
    *c = work_[next_++];
    return true;
  }

  // The record is written before the run: the result that follows it appears at once, so a kill
  // leaves no finished result without its record.
  std::string RunCase(size_t c) {
    const std::string& id = cases_[c].id;
    RemoveResult(options_.out, id);
    const absl::Status recorded = WriteRecord(RecordPath(options_.out, id), records_[c]);
    if (!recorded.ok()) return "cannot write into the output folder";
    const absl::StatusOr<ChildEnd> end = RunChild(cases_[c]);
    const std::string refusal = ReasonOf(end, cases_[c]);
    std::error_code error;
    fs::remove(ErrorsPath(options_.out, id), error);
    // A process that a signal ended leaves its unfinished folder, which may show a face.
    if (!refusal.empty()) RemoveResult(options_.out, id);
    return refusal;
  }

  absl::StatusOr<ChildEnd> RunChild(const CohortCase& row) const {
    ChildOptions child;
    TF_ASSIGN_OR_RETURN(child.program, FindProgram(kOutcomeCommand.program));
    child.arguments = {"outcome", "--out", CaseFolder(options_.out, row.id), "--threads",
                       absl::StrCat(plan_.threads)};
    const std::pair<const char*, const std::string*> inputs[] = {
        {"--pre", &row.pre},
        {"--post", &row.post},
        {"--post-bone", &row.post_bone},
        {"--post-labels", &row.post_labels},
        {"--post-recipe", &row.post_recipe},
        {"--post-axes", &row.post_axes}};
    for (const auto& [option, value] : inputs) {
      if (!value->empty()) child.arguments.insert(child.arguments.end(), {option, *value});
    }
    child.arguments.insert(child.arguments.end(), words_.begin(), words_.end());
    child.errors = ChildStream::File(ErrorsPath(options_.out, row.id));
    TF_ASSIGN_OR_RETURN(const std::unique_ptr<GuardedProgram> program,
                        GuardedProgram::Start(std::move(child), kEndGrace,
                                              {.max_memory_bytes = plan_.memory_bytes}));
    return program->Wait();
  }

  std::string ReasonOf(const absl::StatusOr<ChildEnd>& end, const CohortCase& row) const {
    if (!end.ok()) return WithoutPaths(end.status().message(), row);
    if (end->exit_code == 0) return "";
    if (end->exit_code > 128 || end->exit_code < 0) {
      return absl::StrFormat(
          "its process ended by signal %d; it had %.1f GiB: give more "
          "--memory-gib or fewer --jobs",
          end->exit_code < 0 ? end->signal : end->exit_code - 128,
          static_cast<double>(plan_.memory_bytes) / kBytesPerGib);
    }
    const std::string reason = WithoutPaths(LastError(ErrorsPath(options_.out, row.id)), row);
    return reason.empty() ? "its process failed without a message" : reason;
  }

  const std::vector<CohortCase>& cases_;
  const CohortOptions& options_;
  const JobPlan plan_;
  const std::vector<std::string> words_;
  const Stopwatch stopwatch_;
  std::vector<CohortRecord> records_;  // as many as cases
  std::vector<size_t> work_;           // cases to run; filled before workers begin

  Mutex mutex_;
  size_t next_ ABSL_GUARDED_BY(mutex_) = 0;
  size_t done_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<CohortRun> runs_;  // written under mutex_ while workers run
};

}  // namespace

std::string CasesFolder(const std::string& out) { return out + "/cases"; }

std::string CaseFolder(const std::string& out, const std::string& id) {
  return absl::StrCat(CasesFolder(out), "/", id);
}

absl::StatusOr<std::vector<CohortRun>> RunCohort(const std::vector<CohortCase>& cases,
                                                 const CohortOptions& options) {
  TF_ASSIGN_OR_RETURN(const JobPlan plan, PlanJobs(options));
  TF_RETURN_IF_ERROR(MakeFolders(options.out));
  TF_ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Take(CasesFolder(options.out)));
  return CohortRunner(cases, options, plan).Run();
}

}  // namespace tissueform
