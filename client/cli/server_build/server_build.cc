// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/server_build/server_build.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

#include "client/cli/plan_build/stage_times.h"
#include "client/cli/session/upload_lines.h"
#include "core/base/atomic_file.h"
#include "core/base/atomic_folder.h"
#include "core/base/cancellation.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/planning/plan_building/plan_build_call.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Shares of the whole; building takes most of it.
constexpr double kUploadFrom = 0.05;
constexpr double kBuildFrom = 0.15;
constexpr double kReadFrom = 0.97;

constexpr char kInputsFolder[] = "inputs";

absl::StatusOr<std::string> ReadInput(const fs::path& path) {
  std::error_code error;
  const uintmax_t bytes = fs::file_size(path, error);
  std::string contents(error ? 0 : bytes, '\0');
  std::ifstream stream(path, std::ios::binary);
  if (error || !stream.read(contents.data(), static_cast<std::streamsize>(contents.size()))) {
    return absl::UnavailableError("cannot read back what was prepared for the server");
  }
  return contents;
}

// BuildFile.suffix of a file; its last ending where the server has no longer one.
std::string SuffixOf(const fs::path& path) {
  return absl::EndsWith(path.string(), ".nii.gz") ? ".nii.gz" : path.extension().string();
}

// Only a path below a folder: the server is not trusted with others.
bool IsInside(absl::string_view path) {
  if (path.empty() || path.find('\0') != absl::string_view::npos) return false;
  const std::vector<absl::string_view> parts = absl::StrSplit(path, '/');
  return std::ranges::all_of(
      parts, [](absl::string_view part) { return !part.empty() && part != "." && part != ".."; });
}

class ServerBuild {
 public:
  ServerBuild(PlanBuildCalls* calls, const PlanBuildInputs& inputs, const std::string& title,
              const EndingSignals& signals)
      : calls_(calls), inputs_(inputs), title_(title), signals_(signals), cancellation_([&signals] {
          return signals.arrived();
        }) {}

  absl::StatusOr<ServerBuildResult> Run() {
    TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(inputs_.out));
    ServerBuildResult result;
    TF_ASSIGN_OR_RETURN(result.notes, Prepare(folder.path()));
    const fs::path prepared = fs::path(folder.path()) / kInputsFolder;
    TF_ASSIGN_OR_RETURN(const v1::CreatePlanBuildRequest request, UploadAll(prepared));
    std::error_code error;
    fs::remove_all(prepared, error);
    TF_ASSIGN_OR_RETURN(result.build, Build(request));
    TF_RETURN_IF_ERROR(ReadFiles(result.build, folder.path()));
    times_.End();
    TF_RETURN_IF_ERROR(folder.Publish());
    return result;
  }

 private:
  // Returns lines about the CT.
  absl::StatusOr<std::string> Prepare(const fs::path& folder) {
    std::error_code error;
    if (!fs::create_directory(folder / kInputsFolder, error)) {
      return absl::UnavailableError(
          absl::StrCat("cannot create a folder beside ", inputs_.out, ": ", error.message()));
    }
    TF_ASSIGN_OR_RETURN(const PlanBuildAnswer answer,
                        CallPlanBuild({.ct = inputs_.ct,
                                       .recipe = inputs_.recipe,
                                       .surfaces = inputs_.surfaces,
                                       .labels = inputs_.labels,
                                       .only_write_inputs = true,
                                       .folder = (folder / kInputsFolder).string(),
                                       .folder_name = inputs_.out,
                                       .threads = AvailableProcessors()},
                                      {.on_progress = [this](absl::string_view stage,
                                                             double) { times_.Begin(stage, 0); },
                                       .cancel = signals_.descriptor()}));
    return answer.text;
  }

  // The name of the file on the server.
  absl::StatusOr<std::string> Upload(const fs::path& path, absl::string_view what) {
    TF_ASSIGN_OR_RETURN(const std::string bytes, ReadInput(path));
    times_.Begin(
        absl::StrFormat("uploading %s, %.1f MB", what, 1e-6 * static_cast<double>(bytes.size())),
        kUploadFrom);
    const Stopwatch stopwatch;
    UploadLines lines([](const std::string& line) { absl::FPrintF(stderr, "%s\n", line); },
                      [&stopwatch] { return stopwatch.Seconds(); });
    TF_ASSIGN_OR_RETURN(const v1::BuildFile file,
                        calls_->Upload(bytes, SuffixOf(path), lines.Options(), cancellation_));
    return file.name();
  }

  absl::StatusOr<v1::CreatePlanBuildRequest> UploadAll(const fs::path& folder) {
    v1::CreatePlanBuildRequest request;
    request.set_title(title_);
    if (!inputs_.surfaces.empty()) {
      TF_ASSIGN_OR_RETURN(*request.mutable_surfaces(),
                          Upload(folder / BuildInputFiles::kSurfaces, "the surfaces"));
      return request;
    }
    TF_ASSIGN_OR_RETURN(*request.mutable_recipe_json(),
                        ReadInput(folder / BuildInputFiles::kRecipe));
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().stem().stem() != BuildInputFiles::kLabels) continue;
      TF_ASSIGN_OR_RETURN(*request.mutable_labels(), Upload(entry.path(), "the label map"));
    }
    TF_RETURN_IF_ERROR(UploadRecipeFiles(folder / BuildInputFiles::kRecipeFiles, &request));
    TF_ASSIGN_OR_RETURN(*request.mutable_ct(), Upload(folder / BuildInputFiles::kCt, "the CT"));
    return request;
  }

  absl::Status UploadRecipeFiles(const fs::path& folder, v1::CreatePlanBuildRequest* request) {
    if (!fs::exists(folder)) return absl::OkStatus();
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      v1::RecipeFile* file = request->add_recipe_files();
      file->set_path(entry.path().lexically_relative(folder).generic_string());
      TF_ASSIGN_OR_RETURN(*file->mutable_file(), Upload(entry.path(), file->path()));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<v1::PlanBuild> Build(const v1::CreatePlanBuildRequest& request) {
    TF_RETURN_IF_ERROR(cancellation_.Check());
    TF_ASSIGN_OR_RETURN(const v1::PlanBuild created, calls_->Create(request));
    absl::StatusOr<v1::PlanBuild> done = calls_->Wait(
        created.name(), [this](const v1::PlanBuild& build) { Report(build); }, cancellation_);
    if (cancellation_.requested()) {
      // Also where it is done by now: its result is not wanted.
      TF_RETURN_IF_ERROR(calls_->Cancel(created.name()).status());
      return absl::CancelledError("the build was cancelled");
    }
    TF_RETURN_IF_ERROR(done.status());
    if (done->state() == v1::PLAN_BUILD_STATE_SUCCEEDED) return done;
    return absl::FailedPreconditionError(
        done->state() == v1::PLAN_BUILD_STATE_CANCELLED
            ? "the build was cancelled on the server; start it again"
            : done->detail());
  }

  // Only what has changed: the server sends its state twice a second.
  void Report(const v1::PlanBuild& build) {
    std::string stage = build.stage();
    if (build.state() == v1::PLAN_BUILD_STATE_WAITING) {
      stage =
          absl::StrCat("waiting on the server, builds before this one: ", build.builds_before());
    }
    if (IsDone(build) || stage.empty() || stage == stage_) return;
    stage_ = stage;
    times_.Begin(stage, kBuildFrom + (kReadFrom - kBuildFrom) * build.fraction());
  }

  absl::Status ReadFiles(const v1::PlanBuild& build, const fs::path& folder) {
    times_.Begin("reading the plan from the server", kReadFrom);
    for (const v1::PlanBuildFile& file : build.files()) {
      if (!IsInside(file.path())) {
        return absl::DataLossError(
            "the server names a file of the plan by a path that leads out of its folder");
      }
      TF_ASSIGN_OR_RETURN(const std::string bytes,
                          calls_->ReadFile(build.name(), file.path(), cancellation_));
      const fs::path path = folder / file.path();
      std::error_code error;
      fs::create_directories(path.parent_path(), error);
      TF_RETURN_IF_ERROR(WriteFileAtomically(path.string(), bytes));
    }
    return absl::OkStatus();
  }

  PlanBuildCalls* const calls_;
  const PlanBuildInputs& inputs_;
  const std::string& title_;
  const EndingSignals& signals_;
  const Cancellation cancellation_;
  StageTimes times_;
  std::string stage_;  // of the server, that was shown last
};

}  // namespace

absl::StatusOr<ServerBuildResult> BuildOnServer(PlanBuildCalls* calls,
                                                const PlanBuildInputs& inputs,
                                                const std::string& title,
                                                const EndingSignals& signals) {
  return ServerBuild(calls, inputs, title, signals).Run();
}

}  // namespace tissueform
