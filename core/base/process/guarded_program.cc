// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/guarded_program.h"

#include <cstdlib>
#include <filesystem>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

bool IsProgram(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

// Absolute, for the program may work in another folder. Looked up here and not by the guard, so
// that a missing program is an error of the start and not an exit code to be guessed at.
absl::StatusOr<std::string> ProgramPath(const std::string& program) {
  std::error_code error;
  if (program.find('/') != std::string::npos) {
    if (IsProgram(program)) return fs::absolute(program, error).string();
    return absl::NotFoundError(absl::StrCat("no program ", program));
  }
  const char* folders = std::getenv("PATH");
  for (const absl::string_view folder : absl::StrSplit(folders == nullptr ? "" : folders, ':')) {
    const fs::path path = fs::path(std::string(folder)) / program;
    if (IsProgram(path)) return fs::absolute(path, error).string();
  }
  return absl::NotFoundError(absl::StrCat("no program ", program, " in the folders of PATH"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<GuardedProgram>> GuardedProgram::Start(
    ChildOptions options, std::chrono::milliseconds grace, const ProgramLimits& limits) {
  std::vector<std::string> words = {
      absl::StrCat(grace.count()), absl::StrCat(limits.max_memory_bytes),
      absl::StrCat(limits.max_seconds), absl::StrCat(limits.max_file_bytes)};
  TF_ASSIGN_OR_RETURN(words.emplace_back(), ProgramPath(options.program));
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  options.arguments = std::move(words);
  absl::StatusOr<std::string> guard_program = FindProgram("tissueform-guard");
  // NotFound is for the foreign program: to install that does not bring ours back.
  if (!guard_program.ok()) return absl::FailedPreconditionError(guard_program.status().message());
  options.program = *std::move(guard_program);
  options.input = ChildStream::Pipe();
  options.own_group = true;
  TF_ASSIGN_OR_RETURN(std::unique_ptr<ChildProcess> guard, ChildProcess::Start(options));
  return std::unique_ptr<GuardedProgram>(new GuardedProgram(std::move(guard)));
}

GuardedProgram::~GuardedProgram() {
  Terminate();
  Wait();
}

}  // namespace tissueform
