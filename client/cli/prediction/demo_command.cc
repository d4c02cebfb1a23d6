// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/demo_command.h"

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <signal.h>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/prediction/demo_prediction.h"
#include "client/cli/prediction/demo_report.h"
#include "client/cli/prediction/face_movement.h"
#include "client/cli/prediction/prediction_export.h"
#include "client/cli/prediction/prediction_pictures.h"
#include "client/cli/session/drag.h"
#include "client/cli/session/handle_words.h"
#include "client/cli/session/loopback_port.h"
#include "client/cli/session/server_process.h"
#include "client/cli/session/session_wait.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/demo_paths.h"
#include "client/cli/shared/result_writer.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/atomic_file.h"
#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/plan_io.h"
#include "core/planning/rendering/virtual_display.h"

namespace tissueform {
namespace {

// For a machine that compiles beside it, and for sanitizers.
constexpr std::chrono::seconds kServerStartDeadline{30};

// How far beyond its plan the bundled head is dragged: 8 mm instead of 6. A picture
// shows that at a glance, and no tet is inverted yet (tests/integration/served_command_test.cc).
constexpr double kHeadReach = 4.0 / 3.0;

// Where the planner is by default. Many programs of developers listen there, too.
constexpr int kWebPort = 8080;
constexpr char kPortOption[] = "--port";
constexpr char kWebPortOption[] = "--web-port";

struct DemoOptions {
  std::string out = "out/demo";
  std::string plan;
  int port = 0;
  std::string encoding = "float32";
  bool no_browser = false;
  bool serve = false;
  std::optional<int> web_port;  // unset: kWebPort, or a free one where that is taken
  OpenPlanner open_planner;
  DragOptions drag;

  std::string Path(const std::string& name) const { return out + "/" + name; }
  std::string ResultPath() const { return Path("result.vtu"); }
  std::string SkinPath() const { return Path("skin.stl"); }
  std::string FramesPath() const { return Path("frames.csv"); }
  std::string SummaryPath() const { return Path("summary.json"); }
};

// Set by SIGINT and SIGTERM; the demo then ends by itself, and its server with it.
std::atomic<bool> demo_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set in a signal handler");

void CatchInterrupts() {
  struct sigaction action {};
  action.sa_handler = [](int) { demo_interrupted = true; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

absl::Status CheckNotInterrupted() {
  return demo_interrupted ? absl::CancelledError("interrupted") : absl::OkStatus();
}

// Of ports that the user chose: at once, and not when all else is done.
absl::Status CheckPorts(const DemoOptions& options) {
  TF_RETURN_IF_ERROR(CheckLoopbackPort(options.port, kPortOption));
  if (!options.serve || !options.web_port.has_value()) return absl::OkStatus();
  return CheckLoopbackPort(*options.web_port, kWebPortOption);
}

int WebPort(const DemoOptions& options) {
  if (options.web_port.has_value()) return *options.web_port;
  if (CheckLoopbackPort(kWebPort, kWebPortOption).ok()) return kWebPort;
  absl::PrintF("\nport %d is in use; the planner uses a free one\n", kWebPort);
  return 0;
}

absl::Status MakeOutFolder(const DemoOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot create the folder ", options.out, ": ", error.message()));
  }
  return CheckWritable(options.ResultPath());
}

// A plan with what is dragged: to the plan's pose, the bundled head farther.
struct DemoCase {
  std::string path;
  Plan plan;
  PlanProblem problem;
  std::vector<ComparedRegion> face;
};

absl::StatusOr<DemoCase> ReadCase(const DemoOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string path, FindDemoPlan(options.plan));
  TF_ASSIGN_OR_RETURN(Plan plan, ReadPlan(path));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan));
  TF_ASSIGN_OR_RETURN(std::vector<ComparedRegion> face, FaceRegions(problem));
  if (options.plan.empty()) {
    for (HandlePose& pose : problem.poses) pose = PartOfPose(pose, kHeadReach);
  }
  absl::PrintF("plan %s: %d vertices, %d tets\n", path, problem.mesh->num_vertices(),
               problem.mesh->num_tets());
  return DemoCase{path, std::move(plan), std::move(problem), std::move(face)};
}

absl::StatusOr<DragResult> Drag(const PlanProblem& problem, const DragOptions& options,
                                TissueformClient* client, const std::string& session) {
  TF_ASSIGN_OR_RETURN(DragResult drag,
                      RunDrag(client, session, NamedPoses(problem), options, demo_interrupted));
  if (drag.frames.empty()) {
    return absl::InternalError("the server did not answer any pose");
  }
  return drag;
}

// The same way twice. First a third as long, as a client that knows nothing better would: all
// vertices, every frame solved. Then as one that shows a face: its skin only, from prepared answers
// where the model has them.
struct TwoDrags {
  DragResult solved;
  DragResult skin;
};

absl::StatusOr<TwoDrags> DragTwice(const DemoOptions& options, const PlanProblem& problem,
                                   TissueformClient* client, const std::string& session) {
  DragOptions solved = options.drag;
  solved.seconds /= 3;
  DragOptions skin = options.drag;
  skin.stream.vertices.kind = AnswerVertices::Kind::kSkin;
  if (options.encoding == "int16") skin.stream.encoding = v1::POSITION_ENCODING_INT16_ZSTD;
  if (HasPreparedAnswers(problem.deformer, problem.constraints)) skin.stream.prepared.emplace();
  absl::PrintF("dragging: %s, over %g s at %g poses per second ...\n", MovesInWords(problem),
               options.drag.seconds, options.drag.poses_per_second);
  TwoDrags drags;
  TF_ASSIGN_OR_RETURN(drags.solved, Drag(problem, solved, client, session));
  TF_ASSIGN_OR_RETURN(drags.skin, Drag(problem, skin, client, session));
  return drags;
}

// How exact the frames were, by other ways to the same answers.
absl::StatusOr<DemoDrags> Summarize(const PlanProblem& problem, const TwoDrags& drags,
                                    const Positions& deformed, TissueformClient* client,
                                    const std::string& session) {
  DemoDrags summary;
  TF_ASSIGN_OR_RETURN(summary.solved,
                      SummarizeDrag(drags.solved, problem.mesh->positions(), deformed));
  TF_ASSIGN_OR_RETURN(summary.skin, SummarizeDrag(drags.skin, problem.mesh->positions(), deformed));
  TF_ASSIGN_OR_RETURN(const v1::DeformOnceResponse answer,
                      client->DeformOnce(session, PartOfPoses(NamedPoses(problem), 0)));
  TF_ASSIGN_OR_RETURN(const Positions rest,
                      DecodePositions(answer.positions(), problem.mesh->num_vertices()));
  summary.rest_error_mm = (rest - problem.mesh->positions()).rowwise().norm().maxCoeff();
  return summary;
}

absl::Status WriteResults(const DemoOptions& options, const DemoCase& demo, const DragResult& drag,
                          const DemoDrags& summary, const DemoPrediction& prediction) {
  TF_RETURN_IF_ERROR(WriteFramesCsv(options.FramesPath(), drag));
  TF_RETURN_IF_ERROR(WriteSummaryJson(options.SummaryPath(), summary, prediction));
  TF_RETURN_IF_ERROR(
      WriteResult(options.ResultPath(), demo.plan, demo.problem, prediction.deformed));
  TF_RETURN_IF_ERROR(WriteSkin(options.SkinPath(), demo.problem, prediction.deformed));
  absl::PrintF("\nresults: %s and %s (the end of the drag), %s, %s\n", options.ResultPath(),
               options.SkinPath(), options.FramesPath(), options.SummaryPath());
  return absl::OkStatus();
}

// Pictures are a bonus: where they cannot be made the demo says so and has done its work.
void DrawPictures(const DemoOptions& options, const PlanProblem& problem,
                  const DemoPrediction& prediction, const absl::Status& display) {
  absl::Status drawn = display;
  if (drawn.ok()) {
    drawn = DrawBeforeAndAfter({.skin = BoundaryFacets(*problem.mesh),
                                .rest = problem.mesh->positions(),
                                .deformed = prediction.deformed,
                                .move = prediction.move,
                                .is_face = !prediction.movement.empty()},
                               options.out);
  }
  if (drawn.ok()) {
    absl::PrintF("pictures, before and after: %s in %s\n",
                 absl::StrJoin(BeforeAndAfterPictures(), ", "), options.out);
  } else {
    absl::PrintF("no pictures: %s\n", drawn.message());
  }
}

// How often it is looked whether the server has ended by itself.
constexpr std::chrono::milliseconds kServeStep{200};

// Until Ctrl-C, which is its regular end. A build without Node does not have the planner's pages;
// the server is then served without them.
absl::Status Serve(const DemoOptions& options, const DemoCase& demo, ServerProcess* server) {
  const absl::StatusOr<OpenedPlanner> planner =
      options.open_planner(server->address(), demo.path, WebPort(options));
  if (planner.ok()) {
    absl::PrintF("\nthe planner, in a browser: %s\n", planner->url);
  } else {
    absl::PrintF("\nno planner: %s\n", planner.status().message());
  }
  absl::PrintF(
      "\nthe server keeps running at %s, with its session and predictions, until Ctrl-C. In "
      "another terminal:\n  tissueform prediction list --server %s\n",
      server->address(), server->address());
  while (!demo_interrupted) {
    // Ctrl-C reaches both, in any order.
    if (server->WaitForExit(kServeStep).has_value() && !demo_interrupted) {
      return absl::UnavailableError("the server has stopped");
    }
  }
  return absl::OkStatus();
}

absl::Status DragAndPredict(const DemoOptions& options, const DemoCase& demo, ServerProcess* server,
                            TissueformClient* client, const absl::Status& display) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PlanSession> session,
                      MakePlanSession(client, demo.problem, &demo_interrupted));
  const v1::Session& description = session->description();
  absl::PrintF("session ready: %d free vertices, factorized in %.1f ms, %.1f MiB\n",
               description.free_vertex_count(), description.seconds().factorise() * 1e3,
               static_cast<double>(description.bytes_held()) / (1 << 20));
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  const std::string& name = session->name();
  TF_ASSIGN_OR_RETURN(const TwoDrags drags, DragTwice(options, demo.problem, client, name));
  TF_ASSIGN_OR_RETURN(const DemoPrediction prediction,
                      PredictAtEnd(demo.problem, demo.face, client, name));
  TF_ASSIGN_OR_RETURN(const DemoDrags summary,
                      Summarize(demo.problem, drags, prediction.deformed, client, name));
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  PrintDrags(summary);
  PrintPrediction(prediction);
  PrintKept(prediction);
  PrintInWords(summary, prediction);
  TF_RETURN_IF_ERROR(WriteResults(options, demo, drags.skin, summary, prediction));
  DrawPictures(options, demo.problem, prediction, display);
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  return options.serve ? Serve(options, demo, server) : absl::OkStatus();
}

absl::Status RunDemo(const DemoOptions& options) {
  CatchInterrupts();
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // progress is seen at once, also through a pipe
  TF_RETURN_IF_ERROR(CheckPorts(options));
  TF_RETURN_IF_ERROR(MakeOutFolder(options));
  TF_ASSIGN_OR_RETURN(const DemoCase demo, ReadCase(options));

  TF_ASSIGN_OR_RETURN(const std::string server_program, FindProgram("tissueform-server"));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ServerProcess> server,
                      ServerProcess::Start(server_program,
                                           {"--in-memory", "--host", "127.0.0.1", "--port",
                                            std::to_string(options.port), "--log-level", "warn"},
                                           kServerStartDeadline));
  absl::PrintF("tissueform-server listens on %s\n", server->address());
  const absl::StatusOr<std::unique_ptr<VirtualDisplay>> display = VirtualDisplay::Open();
  TF_RETURN_IF_ERROR(CheckNotInterrupted());
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client,
                      TissueformClient::Connect(server->address(), {}));
  return DragAndPredict(options, demo, server.get(), client.get(), display.status());
}

}  // namespace

void AddDemoCommand(CLI::App& app, OpenPlanner open_planner, CommandWork* work) {
  auto options = std::make_shared<DemoOptions>();
  options->open_planner = std::move(open_planner);
  CLI::App* command = app.add_subcommand(kDemoCommand.name, kDemoCommand.description);
  command
      ->add_option("--out", options->out,
                   "output folder for result.vtu, skin.stl, frames.csv, summary.json and pictures")
      ->capture_default_str();
  command->add_option("--plan", options->plan,
                      "a plan to use instead of the bundled head; it is dragged to its own pose");
  command
      ->add_option("--seconds", options->drag.seconds,
                   "duration of the drag; a drag of a third of that, every frame solved, comes "
                   "first")
      ->check(CLI::Range(0.1, 60.0))
      ->capture_default_str();
  command->add_option(kPortOption, options->port, "port of the server; 0 uses a free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_option("--encoding", options->encoding, "encoding of the frames of the skin")
      ->check(CLI::IsMember({"float32", "int16"}))
      ->capture_default_str();
  command->add_flag("--no-browser", options->no_browser,
                    "for scripts: never open a browser (this version opens none)");
  command->add_flag("--serve", options->serve,
                    "keep the server running at the end, until Ctrl-C, with the planner for "
                    "browsers, and print their addresses");
  command
      ->add_option(kWebPortOption, options->web_port,
                   absl::StrCat("with --serve: port of the planner; 0 uses a free one (default: ",
                                kWebPort, ", or a free one if that is in use)"))
      ->check(CLI::Range(0, 65535));
  command->footer(
      "Starts the tissueform-server in this program's folder on loopback, and stops it at the "
      "end.\n"
      "The server stores the prediction at the end of the drag, and one refined by neo_hookean.\n"
      "The lower jaw of the bundled head moves 8 mm forward, 2 more than in its plan. Open "
      "front.png,\n"
      "left.png and three_quarter.png, and result.vtu or skin.stl in ParaView or 3D Slicer.");
  command->callback([options, work] { *work = [options] { return RunDemo(*options); }; });
}

}  // namespace tissueform
