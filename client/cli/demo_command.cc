// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/demo_command.h"

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <signal.h>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/companion.h"
#include "client/cli/demo_paths.h"
#include "client/cli/demo_report.h"
#include "client/cli/drag.h"
#include "client/cli/plan_session.h"
#include "client/cli/result_writer.h"
#include "client/cli/server_process.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kServerStartDeadline{30};

struct DemoOptions {
  std::string out = "out/demo";
  std::string plan;
  int port = 0;
  bool no_browser = false;

  std::string ResultPath() const { return out + "/result.vtu"; }
  std::string FramesPath() const { return out + "/frames.csv"; }
  std::string SummaryPath() const { return out + "/summary.json"; }
};

// Set by SIGINT and SIGTERM; the demo then ends by itself, and its server with it.
std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set in a signal handler");

void CatchInterrupts() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

absl::Status CheckNotInterrupted() {
  return interrupted ? absl::CancelledError("interrupted") : absl::OkStatus();
}

absl::Status MakeFolder(const DemoOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot make the folder ", options.out, ": ", error.message()));
  }
  return CheckWritable(options.ResultPath());
}

absl::Status Drag(const DemoOptions& options, const PlanProblem& problem, TissueformClient* client,
                  const std::string& session) {
  const std::vector<NamedPose> poses = NamedPoses(problem);
  const DragOptions drag_options;
  absl::PrintF("dragging %d handle(s) for %g s at %g poses a second ...\n", poses.size(),
               drag_options.seconds, drag_options.poses_per_second);
  TF_ASSIGN_OR_RETURN(const DragResult drag,
                      RunDrag(client, session, poses, drag_options, interrupted));
  if (drag.frames.empty()) {
    return absl::InternalError("the server answered no pose");
  }
  TF_ASSIGN_OR_RETURN(const Positions last,
                      DecodePositions(drag.last_positions, problem.mesh->num_vertices()));
  DragSummary summary = SummarizeDrag(drag);
  summary.vertices = problem.mesh->num_vertices();
  summary.rest_error_mm = (last - problem.mesh->positions()).rowwise().norm().maxCoeff();
  TF_RETURN_IF_ERROR(WriteFramesCsv(options.FramesPath(), drag));
  TF_RETURN_IF_ERROR(WriteSummaryJson(options.SummaryPath(), summary));
  PrintDragSummary(summary);
  return absl::OkStatus();
}

absl::Status WriteFullPose(const DemoOptions& options, const Plan& plan, const PlanProblem& problem,
                           TissueformClient* client, const std::string& session) {
  TF_ASSIGN_OR_RETURN(const v1::DeformOnceResponse answer,
                      client->DeformOnce(session, NamedPoses(problem)));
  TF_ASSIGN_OR_RETURN(const Positions deformed,
                      DecodePositions(answer.positions(), problem.mesh->num_vertices()));
  return WriteResult(options.ResultPath(), plan, problem, deformed);
}

absl::Status RunDemo(const DemoOptions& options) {
  CatchInterrupts();
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // progress is seen at once, also through a pipe
  TF_RETURN_IF_ERROR(MakeFolder(options));
  TF_ASSIGN_OR_RETURN(const std::string plan_path, FindDemoPlan(options.plan));
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(plan_path));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan));
  absl::PrintF("plan %s: %d vertices, %d tets\n", plan_path, problem.mesh->num_vertices(),
               problem.mesh->num_tets());

  // Before the client: no thread of gRPC runs yet when the process forks.
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ServerProcess> server,
                      ServerProcess::Start(SiblingProgram("tissueform-server"),
                                           {"--host", "127.0.0.1", "--port",
                                            std::to_string(options.port), "--log-level", "warn"},
                                           kServerStartDeadline));
  absl::PrintF("tissueform-server listens on %s\n", server->address());
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client,
                      TissueformClient::Connect(server->address(), {}));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PlanSession> session,
                      PlanSession::Create(client.get(), problem));
  const v1::Session& description = session->description();
  absl::PrintF("session ready: %d free vertices, factorised in %.1f ms, %.1f MiB\n",
               description.free_vertex_count(), description.seconds().factorise() * 1e3,
               static_cast<double>(description.bytes_held()) / (1 << 20));
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  TF_RETURN_IF_ERROR(Drag(options, problem, client.get(), description.name()));
  TF_RETURN_IF_ERROR(WriteFullPose(options, plan, problem, client.get(), description.name()));
  absl::PrintF("results: %s (the plan's pose), %s, %s\n", options.ResultPath(),
               options.FramesPath(), options.SummaryPath());
  return absl::OkStatus();
}

}  // namespace

void AddDemoCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<DemoOptions>();
  CLI::App* command = app.add_subcommand(kDemoCommand.name, kDemoCommand.description);
  command->add_option("--out", options->out, "folder for result.vtu, frames.csv and summary.json")
      ->capture_default_str();
  command->add_option("--plan", options->plan, "another plan than the bundled one");
  command->add_option("--port", options->port, "port of the server; 0 takes a free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_flag("--no-browser", options->no_browser,
                    "for scripts: never open a browser (this version opens none)");
  command->footer(
      "Starts the tissueform-server that lies beside this program on loopback and ends it again.\n"
      "Open result.vtu in ParaView or 3D Slicer.");
  command->callback([options, work] { *work = [options] { return RunDemo(*options); }; });
}

}  // namespace tissueform
