// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/accuracy/calculix.h"

#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <spawn.h>
#include <unistd.h>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include <sys/wait.h>

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

constexpr char kJob[] = "problem";

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Ours, but with one thread: times are compared with our own on one thread.
std::vector<std::string> ChildEnvironment() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (!absl::StartsWith(*variable, "OMP_NUM_THREADS=")) variables.emplace_back(*variable);
  }
  variables.emplace_back("OMP_NUM_THREADS=1");
  return variables;
}

std::vector<char*> Pointers(std::vector<std::string>* words) {
  std::vector<char*> pointers;
  pointers.reserve(words->size() + 1);
  for (std::string& word : *words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

absl::StatusOr<pid_t> StartProgram(const std::string& folder, const std::string& log) {
  std::vector<std::string> arguments = {"ccx", kJob};
  std::vector<std::string> environment = ChildEnvironment();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  pid_t child = 0;
  const int error = posix_spawnp(&child, "ccx", &actions, nullptr, Pointers(&arguments).data(),
                                 Pointers(&environment).data());
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    return absl::NotFoundError(
        "no program ccx (CalculiX, the independent finite elements); install the package "
        "calculix-ccx");
  }
  if (error != 0) return absl::ErrnoToStatus(error, "cannot start ccx");
  return child;
}

// The first line that says what went wrong, otherwise the last one that says anything.
std::string LastWord(const std::string& log) {
  std::string last = "it printed nothing";
  for (absl::string_view line : absl::StrSplit(log, '\n')) {
    line = absl::StripAsciiWhitespace(line);
    if (absl::StrContains(line, "*ERROR")) return std::string(line);
    if (!line.empty()) last = std::string(line);
  }
  return last;
}

absl::Status RunProgram(const std::string& folder) {
  const std::string log = absl::StrCat(folder, "/", kJob, ".log");
  TF_ASSIGN_OR_RETURN(const pid_t child, StartProgram(folder, log));
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return absl::ErrnoToStatus(errno, "cannot wait for ccx");
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("ccx failed: ", LastWord(ReadText(log)), " (", log, ")"));
}

absl::Status CheckLengths(const CalculixProblem& problem) {
  if (problem.stiffness.size() != problem.mesh.num_tets()) {
    return absl::InvalidArgumentError(absl::StrCat("stiffness has ", problem.stiffness.size(),
                                                   " entries for ", problem.mesh.num_tets(),
                                                   " tets"));
  }
  const auto constrained = static_cast<Eigen::Index>(problem.constraints.constrained().size());
  if (problem.displacements.rows() != constrained) {
    return absl::InvalidArgumentError(absl::StrCat(
        problem.displacements.rows(), " displacements for ", constrained, " constrained vertices"));
  }
  return absl::OkStatus();
}

// One line "node vx vy vz" of a block; false for any other line.
bool ParseRow(absl::string_view line, Positions* displacements, Eigen::Index* rows) {
  const std::vector<absl::string_view> fields =
      absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
  int64_t node = 0;
  Eigen::RowVector3d value;
  if (fields.size() != 4 || !absl::SimpleAtoi(fields[0], &node) || node < 1 ||
      node > displacements->rows()) {
    return false;
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!absl::SimpleAtod(fields[static_cast<size_t>(axis) + 1], &value[axis])) return false;
  }
  displacements->row(node - 1) = value;
  ++*rows;
  return true;
}

// The time that ends the headline of a block.
double TimeOf(absl::string_view headline) {
  const std::vector<absl::string_view> fields =
      absl::StrSplit(headline, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
  double time = 0;
  return absl::SimpleAtod(fields.back(), &time) ? time : 0;
}

}  // namespace

absl::StatusOr<Positions> ParseCalculixDisplacements(absl::string_view dat,
                                                     Eigen::Index num_vertices) {
  constexpr double kWholeLoad = 1 - 1e-6;
  Positions displacements = Positions::Zero(num_vertices, 3);
  Eigen::Index rows = 0;
  double time = 0;
  for (const absl::string_view line : absl::StrSplit(dat, '\n')) {
    if (absl::StrContains(line, "displacements")) {
      time = TimeOf(line);
      rows = 0;
    } else {
      ParseRow(line, &displacements, &rows);
    }
  }
  if (time < kWholeLoad) {
    return absl::InternalError(
        absl::StrCat("ccx printed no displacements at the end of the step, only at time ", time));
  }
  if (rows != num_vertices || !displacements.allFinite()) {
    return absl::InternalError(
        absl::StrCat("ccx printed ", rows, " displacements for ", num_vertices, " vertices"));
  }
  return displacements;
}

absl::StatusOr<CalculixResult> RunCalculix(const CalculixProblem& problem,
                                           const std::string& folder) {
  TF_RETURN_IF_ERROR(CheckLengths(problem));
  const std::string job = absl::StrCat(folder, "/", kJob);
  TF_RETURN_IF_ERROR(WriteFileAtomically(job + ".inp", CalculixInput(problem)));
  std::error_code ignored;
  std::filesystem::remove(job + ".dat", ignored);  // of a former run
  const Stopwatch stopwatch;
  TF_RETURN_IF_ERROR(RunProgram(folder));
  CalculixResult result;
  result.seconds = stopwatch.Seconds();
  TF_ASSIGN_OR_RETURN(result.deformed, ParseCalculixDisplacements(ReadText(job + ".dat"),
                                                                  problem.mesh.num_vertices()));
  result.deformed += problem.mesh.positions();
  return result;
}

}  // namespace tissueform
