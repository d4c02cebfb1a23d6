// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/process_benchmark.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/cli/shared/demo_paths.h"
#include "client/lab/accuracy/calculix.h"
#include "core/base/percentiles.h"
#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/plan_io.h"

namespace tissueform::benchmarks {
namespace {

constexpr double kAgreement = 1e-3;  // of the largest displacement

class TemporaryFolder {
 public:
  TemporaryFolder()
      : path_((std::filesystem::temp_directory_path() / "tissueform-XXXXXX").string()) {
    made_ = mkdtemp(path_.data()) != nullptr;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    if (made_) std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  bool made() const { return made_; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool made_ = false;
};

absl::StatusOr<CalculixProblem> ProblemOf(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(path));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan));
  return CalculixProblem{
      .mesh = *problem.mesh,
      .stiffness = problem.stiffness,
      .poisson_ratio = plan.poisson_ratio,
      .constraints = problem.constraints,
      .displacements = ConstrainedDisplacements(*problem.mesh, problem.constraints, problem.poses),
      .law = CalculixLaw::kNeoHookean};
}

absl::StatusOr<double> RunOurs(const std::string& plan, const std::string& out, int threads) {
  ChildOptions options;
  TF_ASSIGN_OR_RETURN(options.program, FindProgram("tissueform"));
  options.arguments = {"deform", plan, "--model", "neo_hookean", "--threads", absl::StrCat(threads),
                       "--out",  out};
  options.output = options.errors = ChildStream::File(out + ".log");
  const Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(const auto child, ChildProcess::Start(options));
  if (child->Wait().exit_code != 0) {
    return absl::InternalError(
        absl::StrCat("tissueform deform ", plan, " failed; see ", out, ".log"));
  }
  return stopwatch.Seconds();
}

absl::Status CheckAgreement(const std::string& result, const TetMesh& rest,
                            const Positions& reference) {
  TF_ASSIGN_OR_RETURN(const TetMeshFile ours, ReadTetMesh(result));
  const double moved = (reference - rest.positions()).rowwise().norm().maxCoeff();
  const double off = (ours.mesh.positions() - reference).rowwise().norm().maxCoeff();
  if (off <= kAgreement * moved) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("our answer differs by ", off, " mm from CalculiX's"));
}

}  // namespace

std::string ProcessProblemName(int number) { return number == kBlock ? "block" : "tongue"; }

absl::StatusOr<BenchmarkRow> MeasureAgainstCalculix(int number, int repetitions, int threads) {
  TF_ASSIGN_OR_RETURN(const std::string plan, FindBundledPlan(ProcessProblemName(number)));
  TF_ASSIGN_OR_RETURN(const CalculixProblem problem, ProblemOf(plan));
  const TemporaryFolder folder;
  if (!folder.made()) return absl::ErrnoToStatus(errno, "cannot create a temporary folder");
  const std::string result = folder.path() + "/ours.vtu";
  std::vector<double> ours;
  std::vector<double> peers;
  for (int i = 0; i < repetitions; ++i) {
    TF_ASSIGN_OR_RETURN(const double seconds, RunOurs(plan, result, threads));
    TF_ASSIGN_OR_RETURN(const CalculixResult peer, RunCalculix(problem, folder.path()));
    TF_RETURN_IF_ERROR(CheckAgreement(result, problem.mesh, peer.deformed));
    ours.push_back(seconds);
    peers.push_back(peer.seconds);
  }
  BenchmarkRow row;
  row.work = "neo_hookean, process";
  row.mesh = ProcessProblemName(number);
  row.vertices = problem.mesh.num_vertices();
  row.tets = problem.mesh.num_tets();
  row.ours_seconds = Median(ours);
  row.peer = "ccx";
  row.peer_seconds = Median(peers);
  return row;
}

}  // namespace tissueform::benchmarks
