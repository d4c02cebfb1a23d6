// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/load_command.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/session/server_connection.h"
#include "client/cli/session/server_process.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/demo_paths.h"
#include "client/lab/load/bare_transport.h"
#include "client/lab/load/cluster_load.h"
#include "client/lab/load/cluster_report.h"
#include "client/lab/load/load_report.h"
#include "client/lab/load/load_run.h"
#include "core/base/atomic_file.h"
#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kServerStartDeadline{30};

struct LoadCommandOptions {
  LoadOptions load;
  bool cluster = false;
  ClusterLoadOptions cluster_load;  // what is of --cluster alone
  ServerConnection server;
  std::string plan;
  std::string model = "linear_elastic";
  std::string encoding = "float32";
  std::string json;
};

// Plans of the bundled head say gradient_field; what a drag is mostly asked for is elasticity.
DeformationModel ModelOf(const std::string& name) {
  if (name == "gradient_field") return DeformationModel::kGradientField;
  return name == "neo_hookean" ? DeformationModel::kNeoHookean : DeformationModel::kLinearElastic;
}

absl::Status CheckOptions(const LoadCommandOptions& options) {
  const LoadOptions& load = options.load;
  if (options.cluster && load.sessions == 0) {
    return absl::InvalidArgumentError("--cluster needs drags; set --sessions");
  }
  if (load.sessions + load.slow_readers + load.refining + load.churn == 0) {
    return absl::InvalidArgumentError(
        "there is no work; set --sessions, --slow-readers, --refining or --churn");
  }
  if (load.bare && load.sessions + load.slow_readers + load.refining == 0) {
    return absl::InvalidArgumentError(
        "--bare sends frames of the size of a drag's; set "
        "--sessions");
  }
  if (!options.json.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.json));
  return absl::OkStatus();
}

absl::Status KeepJson(const std::string& path, const nlohmann::ordered_json& json) {
  return path.empty() ? absl::OkStatus() : WriteFileAtomically(path, json.dump(2) + "\n");
}

absl::Status FirstOf(const std::vector<absl::Status>& errors) {
  if (errors.empty()) return absl::OkStatus();
  return absl::InternalError(
      absl::StrCat(errors.size(), " calls failed; the first: ", errors.front().message()));
}

absl::Status RunOnCluster(const LoadCommandOptions& options, const ServerConnection& connection,
                          const PlanProblem& problem) {
  ClusterLoadOptions load = options.cluster_load;
  load.sessions = options.load.sessions;
  load.poses_per_second = options.load.poses_per_second;
  load.seconds = options.load.seconds;
  load.int16 = options.load.int16;
  TF_ASSIGN_OR_RETURN(const ClusterLoadResult result, RunClusterLoad(connection, problem, load));
  absl::PrintF("prepared in %.1f s, then %g s\n%s", result.preparing_seconds, load.seconds,
               ClusterLoadText(load, result));
  TF_RETURN_IF_ERROR(KeepJson(options.json, ClusterLoadJson(load, result)));
  return FirstOf(result.errors);
}

absl::Status Run(const LoadCommandOptions& options) {
  const LoadOptions& load = options.load;
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_ASSIGN_OR_RETURN(const std::string path, FindDemoPlan(options.plan));
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(path));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan));
  problem.deformer.model = ModelOf(options.model);
  std::unique_ptr<ServerProcess> server;
  ServerConnection connection = options.server;
  if (connection.address.empty()) {
    TF_ASSIGN_OR_RETURN(const std::string program, FindProgram("tissueform-server"));
    TF_ASSIGN_OR_RETURN(
        server,
        ServerProcess::Start(program,
                             {"--in-memory", "--host", "127.0.0.1", "--port", "0", "--max-sessions",
                              "4096", "--max-streams", "4096", "--log-level", "warn"},
                             kServerStartDeadline));
    connection = {.address = server->address()};
  }
  absl::FPrintF(stderr, "plan %s: %d vertices, %d tets, %s; preparing %d drags on %s ...\n", path,
                problem.mesh->num_vertices(), problem.mesh->num_tets(), options.model,
                load.sessions + load.slow_readers + load.refining, connection.address);
  if (options.cluster) return RunOnCluster(options, connection, problem);
  TF_ASSIGN_OR_RETURN(LoadResult result, RunLoad(connection, problem, options.load));
  if (load.bare && !result.drags.empty() && result.drags.front().frames > 0) {
    const DragLoad& drags = result.drags.front();
    TF_ASSIGN_OR_RETURN(
        result.bare_latencies_ms,
        MeasureBareTransport(drags.bytes / drags.frames, load.poses_per_second, load.seconds));
  }
  absl::PrintF("prepared in %.1f s, then %g s\n%s", result.preparing_seconds, options.load.seconds,
               LoadText(options.load, result));
  TF_RETURN_IF_ERROR(KeepJson(options.json, LoadJson(load, result)));
  return FirstOf(result.errors);
}

void AddClusterOptions(CLI::App* command, LoadCommandOptions* options) {
  ClusterLoadOptions& load = options->cluster_load;
  CLI::Option* cluster =
      command
          ->add_flag("--cluster", options->cluster,
                     "report each server behind one name; drags reattach and commit")
          ->excludes("--churn")
          ->excludes("--slow-readers")
          ->excludes("--refining")
          ->excludes("--in-phase")
          ->excludes("--bare");
  command
      ->add_option("--followers", load.followers,
                   "watches, spread over the sessions; with --cluster")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str()
      ->needs(cluster);
  command
      ->add_option("--commit-seconds", load.commit_seconds,
                   "between two commits of a drag, 0: none; with --cluster")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str()
      ->needs(cluster);
}

void AddOptions(CLI::App* command, LoadCommandOptions* options) {
  LoadOptions& load = options->load;
  command->add_option("--server", options->server.address, "a running server (default: start one)")
      ->type_name("HOST:PORT");
  AddConnectionOptions(command, &options->server.options);
  command->add_option("--plan", options->plan, "a plan to use instead of the bundled head");
  command->add_option("--model", options->model, "model of the drags")
      ->check(CLI::IsMember({"gradient_field", "linear_elastic", "neo_hookean"}))
      ->capture_default_str();
  command->add_option("--sessions", load.sessions, "drags from prepared answers")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();
  command->add_option("--rate", load.poses_per_second, "poses per second and drag")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--seconds", load.seconds, "duration")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  command
      ->add_option("--churn", load.churn, "clients that create and delete sessions, all different")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  command
      ->add_option("--slow-readers", load.slow_readers,
                   "additional drags whose client needs --slow-ms per frame")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();
  command->add_option("--slow-ms", load.slow_ms, "time a slow reader needs per frame")
      ->check(CLI::Range(0.0, 10000.0))
      ->capture_default_str();
  command->add_option("--refining", load.refining, "additional drags with neo_hookean")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  command->add_option("--encoding", options->encoding, "encoding of frames")
      ->check(CLI::IsMember({"float32", "int16"}))
      ->capture_default_str();
  command->add_flag("--in-phase", load.in_phase,
                    "all drags send at the same time (default: spread out)");
  command->add_flag("--bare", load.bare,
                    "afterwards also time frames of the same size without computation, through\n"
                    "gRPC alone: a lower bound of a drag's latency");
  command->add_option("--json", options->json, "also write the figures to this JSON file");
  AddClusterOptions(command, options);
}

}  // namespace

void AddLoadCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<LoadCommandOptions>();
  CLI::App* command = app.add_subcommand(kLoadCommand.name, kLoadCommand.description);
  AddOptions(command, options.get());
  command->footer(
      "Each drag has its own session and connection and requests the skin. The frame's\n"
      "age is sampled every 10 ms: now minus the time when the newest shown pose was sent, so "
      "that\n"
      "dropped poses count; the interval between poses is part of it. The clients also run\n"
      "on this machine and use processor time. Exit code 1 if a call fails.\n"
      "With --cluster each session has a random id, by whose hash a proxy distributes them, and "
      "the\n"
      "figures are per server, by its name.\n"
      "Examples:\n"
      "  tissueform load --sessions 32 --rate 30 --churn 2 --seconds 60 --json load.json\n"
      "  tissueform load --server localhost:50051 --sessions 1 --churn 0 --seconds 10\n"
      "  tissueform load --cluster --server localhost:50052 --sessions 24 --followers 24\n"
      "Results: docs/performance.md and docs/scaling.md.");
  command->callback([options, work] {
    options->load.int16 = options->encoding == "int16";
    *work = [options] { return Run(*options); };
  });
}

}  // namespace tissueform
