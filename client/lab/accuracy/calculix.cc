// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/calculix.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

#include "core/base/atomic_file.h"
#include "core/base/process/guarded_program.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

constexpr char kJob[] = "problem";
constexpr std::chrono::seconds kEndGrace{2};

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// The first line that says what went wrong, otherwise the last one that says anything.
std::string LastWord(const std::string& log) {
  std::string last = "its output is empty";
  for (absl::string_view line : absl::StrSplit(log, '\n')) {
    line = absl::StripAsciiWhitespace(line);
    if (absl::StrContains(line, "*ERROR")) return std::string(line);
    if (!line.empty()) last = std::string(line);
  }
  return last;
}

absl::Status RunProgram(const std::string& folder) {
  const std::string log = absl::StrCat(folder, "/", kJob, ".log");
  ChildOptions options;
  options.program = "ccx";
  options.arguments = {kJob};
  options.environment = {"OMP_NUM_THREADS=1"};  // times are compared with our own on one thread
  options.folder = folder;
  options.output = ChildStream::File(log);
  options.errors = ChildStream::File(log);
  const auto ccx = GuardedProgram::Start(std::move(options), kEndGrace);
  if (absl::IsNotFound(ccx.status())) {
    return absl::NotFoundError(
        "the program ccx (CalculiX, the finite-element reference) is missing; install the package "
        "calculix-ccx");
  }
  TF_RETURN_IF_ERROR(ccx.status());
  if ((*ccx)->Wait().exit_code == 0) return absl::OkStatus();
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
  const auto rows = static_cast<Eigen::Index>(problem.constraints.contact().size());
  if (problem.bone_motions.size() != rows) {
    return absl::InvalidArgumentError(
        absl::StrCat(problem.bone_motions.size(), " bone motions for ", rows, " contact rows"));
  }
  return absl::OkStatus();
}

// One line of a block, "number v v v": a vertex or tet, for stresses with the number of its
// integration point, and its values. False for any other line.
template <typename Values>
bool ParseRow(absl::string_view line, Eigen::Index numbers, Values* values) {
  const std::vector<absl::string_view> fields =
      absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
  int64_t row = 0;
  if (static_cast<Eigen::Index>(fields.size()) != numbers + values->cols() ||
      !absl::SimpleAtoi(fields[0], &row) || row < 1 || row > values->rows()) {
    return false;
  }
  Eigen::RowVectorXd value(values->cols());
  for (Eigen::Index c = 0; c < value.size(); ++c) {
    if (!absl::SimpleAtod(fields[static_cast<size_t>(numbers + c)], &value[c])) return false;
  }
  values->row(row - 1) = value;
  return true;
}

// The time that ends the headline of a block.
double TimeOf(absl::string_view headline) {
  const std::vector<absl::string_view> fields =
      absl::StrSplit(headline, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
  double time = 0;
  return absl::SimpleAtod(fields.back(), &time) ? time : 0;
}

// What is printed of a quantity at the end of the step: "displacements" in the headline, so many
// numbers before the values of a line, rows for so many vertices or tets.
struct Quantity {
  const char* name;
  Eigen::Index numbers;
  Eigen::Index rows;
  Eigen::Index columns;
};

template <typename Values>
absl::StatusOr<Values> ParseBlocks(absl::string_view dat, const Quantity& quantity) {
  constexpr double kWholeLoad = 1 - 1e-6;
  Values values = Values::Zero(quantity.rows, quantity.columns);
  Eigen::Index rows = 0;
  double time = 0;
  bool is_wanted = false;
  for (const absl::string_view line : absl::StrSplit(dat, '\n')) {
    // A later block overwrites those of earlier increments; the time in its headline says whether
    // it is that of the whole load. Blocks of one time are parts of one another's.
    if (absl::StrContains(line, "time")) {
      is_wanted = absl::StrContains(line, quantity.name);
      if (!is_wanted) continue;
      if (TimeOf(line) != time) rows = 0;
      time = TimeOf(line);
    } else if (is_wanted && ParseRow(line, quantity.numbers, &values)) {
      ++rows;
    }
  }
  if (time < kWholeLoad) {
    return absl::InternalError(absl::StrCat("ccx printed no ", quantity.name,
                                            " at the end of the step, only at time ", time));
  }
  if (rows != quantity.rows || !values.allFinite()) {
    return absl::InternalError(absl::StrCat("ccx printed ", rows, " ", quantity.name, " for ",
                                            quantity.rows,
                                            quantity.numbers == 1 ? " vertices" : " tets"));
  }
  return values;
}

absl::Status ParseResult(const CalculixProblem& problem, const std::string& dat,
                         CalculixResult* result) {
  TF_ASSIGN_OR_RETURN(result->deformed,
                      ParseCalculixDisplacements(dat, problem.mesh.num_vertices()));
  const double scale = MotionScale(problem);
  result->deformed = result->deformed / scale + problem.mesh.positions();
  if (!problem.forces_and_stresses) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(result->forces, ParseCalculixForces(dat, problem.mesh.num_vertices()));
  TF_ASSIGN_OR_RETURN(result->stresses, ParseCalculixStresses(dat, problem.mesh.num_tets()));
  result->forces /= scale;
  result->stresses /= scale;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Positions> ParseCalculixDisplacements(absl::string_view dat,
                                                     Eigen::Index num_vertices) {
  return ParseBlocks<Positions>(dat, {"displacements", 1, num_vertices, 3});
}

absl::StatusOr<Positions> ParseCalculixForces(absl::string_view dat, Eigen::Index num_vertices) {
  return ParseBlocks<Positions>(dat, {"forces", 1, num_vertices, 3});
}

absl::StatusOr<Eigen::MatrixXd> ParseCalculixStresses(absl::string_view dat,
                                                      Eigen::Index num_tets) {
  return ParseBlocks<Eigen::MatrixXd>(dat, {"stresses", 2, num_tets, 6});
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
  TF_RETURN_IF_ERROR(ParseResult(problem, ReadText(job + ".dat"), &result));
  return result;
}

}  // namespace tissueform
