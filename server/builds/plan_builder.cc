// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/plan_builder.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include <sys/mman.h>

#include "core/base/atomic_folder.h"
#include "core/base/process/child_process.h"
#include "core/base/process/tissueform_command.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/session_store.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Of `case pack`, which takes seconds.
constexpr std::chrono::minutes kPackTime{10};
constexpr size_t kCaseTitleDigits = 8;
constexpr int64_t kPieceBytes = int64_t{1} << 20;

// In the work folder: what the recipe names lies beside it, the CT beside both.
struct Inputs {
  std::string ct;
  std::string labels;
  std::string recipe;
  std::string surfaces;
};

absl::StatusOr<std::string> LinkFile(const PlanBuildJob& job, const std::string& name,
                                     absl::string_view as, BuildFiles* files) {
  if (name.empty()) return std::string();
  const std::string sha256 = name.substr(name.rfind('/') + 1);
  TF_ASSIGN_OR_RETURN(const BuildFileRecord file, files->Find(job.owner, sha256));
  const std::string path = absl::StrCat(job.work_folder, "/", as, file.suffix);
  TF_RETURN_IF_ERROR(files->Link(job.owner, sha256, path));
  return path;
}

absl::Status LinkRecipeFiles(const PlanBuildJob& job, const std::string& folder,
                             BuildFiles* files) {
  for (const v1::RecipeFile& file : job.request.recipe_files()) {
    const std::string path = absl::StrCat(folder, "/", file.path());
    std::error_code error;
    fs::create_directories(fs::path(path).parent_path(), error);
    if (error) return FileError(error.value(), "cannot make a folder for", path);
    const std::string sha256 = file.file().substr(file.file().rfind('/') + 1);
    TF_RETURN_IF_ERROR(files->Link(job.owner, sha256, path));
  }
  return absl::OkStatus();
}

absl::StatusOr<Inputs> LinkInputs(const PlanBuildJob& job, BuildFiles* files) {
  Inputs inputs;
  TF_ASSIGN_OR_RETURN(inputs.ct, LinkFile(job, job.request.ct(), "ct", files));
  TF_ASSIGN_OR_RETURN(inputs.labels, LinkFile(job, job.request.labels(), "labels", files));
  TF_ASSIGN_OR_RETURN(inputs.surfaces, LinkFile(job, job.request.surfaces(), "surfaces", files));
  if (job.request.recipe_json().empty()) return inputs;
  const std::string folder = job.work_folder + "/recipe";
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  TF_RETURN_IF_ERROR(LinkRecipeFiles(job, folder, files));
  inputs.recipe = folder + "/recipe.json";
  TF_RETURN_IF_ERROR(WriteDurably(inputs.recipe, {job.request.recipe_json()}));
  return inputs;
}

// Mesa compiles what it draws with. A unit with MemoryDenyWriteExecute forbids that, to programs
// that this one starts, too.
bool MayMakeCode() {
  const auto bytes = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  void* const page =
      mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (page == MAP_FAILED) return false;
  const bool may = mprotect(page, bytes, PROT_READ | PROT_EXEC) == 0;
  munmap(page, bytes);
  return may;
}

// Without a display and without Xvfb the report has no pictures.
bool CanDraw() {
  if (!MayMakeCode()) return false;
  if (std::getenv("DISPLAY") != nullptr) return true;
  const char* const folders = std::getenv("PATH");
  const std::vector<std::string> all = absl::StrSplit(folders == nullptr ? "" : folders, ':');
  return std::any_of(all.begin(), all.end(), [](const std::string& folder) {
    return access(absl::StrCat(folder, "/Xvfb").c_str(), X_OK) == 0;
  });
}

absl::StatusOr<PlanBuildAnswer> Build(const PlanBuildJob& job, const Inputs& inputs,
                                      const PlanBuildLimits& limits, const std::string& folder) {
  PlanBuildCallOptions calling;
  calling.on_progress = job.on_stage;
  calling.cancel = job.cancel;
  return CallPlanBuild({.ct = inputs.ct,
                        .recipe = inputs.recipe,
                        .surfaces = inputs.surfaces,
                        .labels = inputs.labels,
                        .folder = folder,
                        .folder_name = "plan",
                        .threads = job.threads,
                        .pictures = CanDraw(),
                        .limits = {.max_memory_bytes = limits.max_memory_bytes,
                                   .max_seconds = limits.max_seconds,
                                   .max_file_bytes = limits.max_output_bytes}},
                       calling);
}

// Its file names no patient: what its owner calls the case is in the store alone.
std::string TitleInFile(const std::string& id) {
  return absl::StrCat("Case ", id.substr(id.size() - std::min(id.size(), kCaseTitleDigits)));
}

absl::StatusOr<std::string> PackCase(const PlanBuildJob& job, const std::string& plan_folder) {
  const std::string path = job.work_folder + "/made.tfcase";
  TF_RETURN_IF_ERROR(RunTissueform({"case", "pack", plan_folder + "/plan.json", "--out", path,
                                    "--title", TitleInFile(job.id), "--overwrite"},
                                   "packing the case", job.work_folder + "/pack.log", kPackTime,
                                   job.cancel));
  return path;
}

absl::StatusOr<std::string> StoreCase(const PlanBuildJob& job, const std::string& path,
                                      CaseStore* cases, int max_cases) {
  TF_ASSIGN_OR_RETURN(const OpenFile file, OpenFile::Open(path, O_RDONLY));
  TF_ASSIGN_OR_RETURN(const int64_t size, file.Size());
  Sha256 digest;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&digest](absl::string_view piece) {
    digest.Add(piece);
    return absl::OkStatus();
  }));
  const int64_t now_s = SystemUnixSeconds();
  const CaseRecord record{.sha256 = digest.Hex(),
                          .owner = job.owner,
                          .project = job.request.project(),
                          .title = job.request.title(),
                          .total_bytes = size,
                          .created_s = now_s,
                          .last_used_s = now_s};
  if (cases->Find(record.key()).ok()) return record.sha256;
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<CaseWriter> writer, cases->Begin(record, max_cases));
  for (int64_t offset = 0; offset < size; offset += kPieceBytes) {
    TF_ASSIGN_OR_RETURN(const std::string piece,
                        file.ReadAt(offset, std::min(kPieceBytes, size - offset)));
    TF_RETURN_IF_ERROR(writer->Write(offset, piece));
  }
  TF_RETURN_IF_ERROR(writer->Finish().status());
  return record.sha256;
}

// Paths below a folder become names of files.
void KeepFileNames(const std::string& folder, std::string* message) {
  const std::string prefix = folder + "/";
  for (size_t at = message->find(prefix); at != std::string::npos; at = message->find(prefix, at)) {
    const size_t end =
        std::min(message->find_first_of(" :,;\"'()", at + prefix.size()), message->size());
    message->erase(at, message->rfind('/', end - 1) + 1 - at);
  }
}

// Messages of programs name the files that they were given: a recipe's by its paths in it, those of
// a zip, which is unpacked next to the result, by their names.
absl::Status WithoutPaths(const absl::Status& status, const PlanBuildJob& job) {
  std::string message = absl::StrReplaceAll(
      status.message(), {{job.work_folder + "/recipe/", ""}, {job.work_folder + "/", ""}});
  KeepFileNames(std::filesystem::path(job.result_folder).parent_path().string(), &message);
  if (absl::StrContains(message, "bytes of memory")) {
    absl::StrAppend(&message, " (--max-build-memory-mib); crop the CT, or ask the operator");
  }
  return absl::Status(status.code(), message);
}

absl::StatusOr<BuiltPlan> BuildStepByStep(const PlanBuildJob& job, const PlanBuildLimits& limits,
                                          BuildFiles* files, CaseStore* cases, int max_cases) {
  TF_ASSIGN_OR_RETURN(const Inputs inputs, LinkInputs(job, files));
  TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(job.result_folder));
  TF_ASSIGN_OR_RETURN(PlanBuildAnswer made, Build(job, inputs, limits, folder.path()));
  job.on_stage("packing the case", 1);
  TF_ASSIGN_OR_RETURN(const std::string packed, PackCase(job, folder.path()));
  TF_RETURN_IF_ERROR(folder.Publish());
  BuiltPlan plan{
      .is_ready = made.ready, .defects = std::move(made.defects), .summary = std::move(made.text)};
  TF_ASSIGN_OR_RETURN(plan.case_sha256, StoreCase(job, packed, cases, max_cases));
  return plan;
}

}  // namespace

absl::Status NoPlanBuilds() {
  return absl::FailedPreconditionError(
      "this server builds no plans (--plan-builds 0, or without the programs beside it); build the "
      "plan with `tissueform plan build` on a machine of your own");
}

absl::Status CheckPlanBuildPrograms() {
  for (const absl::string_view name : {"tissueform-plan-build", "tissueform"}) {
    if (FindProgram(name).ok()) continue;
    return absl::FailedPreconditionError(absl::StrCat("this server builds no plans: the program ",
                                                      name, " is not installed beside it"));
  }
  return absl::OkStatus();
}

absl::StatusOr<BuiltPlan> BuildPlanOf(const PlanBuildJob& job, const PlanBuildLimits& limits,
                                      BuildFiles* files, CaseStore* cases, int max_cases) {
  absl::StatusOr<BuiltPlan> plan = BuildStepByStep(job, limits, files, cases, max_cases);
  if (!plan.ok()) return WithoutPaths(plan.status(), job);
  return plan;
}

std::vector<v1::PlanBuildFile> ListPlanBuildFiles(const std::string& folder) {
  std::vector<v1::PlanBuildFile> files;
  std::error_code error;
  for (const auto& entry : fs::recursive_directory_iterator(folder, error)) {
    if (!entry.is_regular_file()) continue;
    v1::PlanBuildFile file;
    file.set_path(entry.path().lexically_relative(folder).string());
    file.set_total_bytes(static_cast<int64_t>(entry.file_size()));
    files.push_back(std::move(file));
  }
  std::sort(files.begin(), files.end(),
            [](const auto& a, const auto& b) { return a.path() < b.path(); });
  return files;
}

}  // namespace tissueform
