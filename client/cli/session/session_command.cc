// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/session_command.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/session/model_option.h"
#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/session/session_wait.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/option_checks.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

struct SessionOptions {
  ServerConnection server;
  std::string name;
  // Of an update; empty: as it is.
  std::string etag;
  std::string model;
  std::optional<double> stiffness_pa;
  std::string stiffness_array;
  std::optional<double> poisson_ratio;
  std::string regions;  // a plan
  PlanReadOptions reading;
};

std::string StateText(const v1::Session& session) {
  if (session.state() == v1::SESSION_STATE_STORED) return "stored";
  return absl::StrFormat("ready, %.0f MiB", static_cast<double>(session.bytes_held()) / (1 << 20));
}

absl::Status List(const SessionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, client->ListSessions());
  absl::PrintF("%-44s %-16s %-16s %-20s %s\n", "session", "state", "model", "last used", "handles");
  for (const v1::Session& session : sessions) {
    absl::PrintF("%-44s %-16s %-16s %-20s %s\n", session.name(), StateText(session),
                 ModelText(session.model()), TimeText(session.last_use_time()),
                 absl::StrJoin(session.handles(), ", "));
  }
  absl::PrintF("%d sessions\n", sessions.size());
  return absl::OkStatus();
}

absl::Status Show(const SessionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::Session session, client->GetSession(FullSessionName(options.name)));
  absl::PrintF("%s\n", session.DebugString());
  return absl::OkStatus();
}

// Vertices are numbers: they say something on a mesh with the same ones only. A plan's stiffness is
// part of its mesh's name, but may be another one here.
absl::Status CheckSameVertices(TissueformClient* client, const std::string& session,
                               const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const v1::Session described, client->GetSession(session));
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh, client->GetMesh(described.mesh()));
  if (mesh.vertex_count() == problem.mesh->num_vertices() &&
      mesh.tet_count() == problem.mesh->num_tets()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "the plan's mesh has %d vertices and %d tets, the mesh of %s %d and %d; use a plan of the "
      "same mesh",
      problem.mesh->num_vertices(), problem.mesh->num_tets(), session, mesh.vertex_count(),
      mesh.tet_count()));
}

absl::Status SetRegions(const SessionOptions& options, TissueformClient* client,
                        v1::UpdateSessionRequest* request) {
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.regions, options.reading));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  TF_RETURN_IF_ERROR(CheckSameVertices(client, request->name(), problem));
  v1::CreateSessionRequest of_plan = ToProto(SessionRequestOf(problem, ""));
  v1::SessionRegions* regions = request->mutable_regions();
  *regions->mutable_fixed_vertices() = std::move(*of_plan.mutable_fixed_vertices());
  *regions->mutable_handles() = std::move(*of_plan.mutable_handles());
  *regions->mutable_contact() = std::move(*of_plan.mutable_contact());
  if (of_plan.has_lip_edge()) {
    *regions->mutable_lip_edge() = std::move(*of_plan.mutable_lip_edge());
  }
  return absl::OkStatus();
}

absl::Status Update(const SessionOptions& options) {
  v1::UpdateSessionRequest request;
  request.set_name(FullSessionName(options.name));
  request.set_etag(options.etag);
  TF_ASSIGN_OR_RETURN(const v1::DeformationModel model, ModelOf(options.model));
  request.set_model(model);
  if (options.stiffness_pa.has_value()) {
    request.mutable_stiffness()->set_uniform_pa(*options.stiffness_pa);
  } else if (!options.stiffness_array.empty()) {
    request.mutable_stiffness()->set_cell_array(options.stiffness_array);
  }
  if (options.poisson_ratio.has_value()) request.set_poisson_ratio(*options.poisson_ratio);
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  if (!options.regions.empty()) TF_RETURN_IF_ERROR(SetRegions(options, client.get(), &request));
  TF_ASSIGN_OR_RETURN(const v1::Session session, UpdateWithProgress(client.get(), request));
  absl::PrintF("prepared %s again: %s, handles %s, %d vertices fixed, etag %s\n", session.name(),
               ModelText(session.model()), absl::StrJoin(session.handles(), ", "),
               session.fixed_vertex_count(), session.etag());
  return absl::OkStatus();
}

absl::Status Delete(const SessionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_RETURN_IF_ERROR(client->DeleteSession(FullSessionName(options.name)));
  absl::PrintF("deleted %s\n", FullSessionName(options.name));
  return absl::OkStatus();
}

void AddUpdateOptions(CLI::App* command, SessionOptions* options) {
  AddModelOption(command, "use this model instead of the session's", &options->model);
  CLI::Option* uniform =
      command->add_option("--stiffness-pa", options->stiffness_pa, "the same for every tet, in Pa");
  command
      ->add_option("--stiffness-array", options->stiffness_array,
                   "cell array of the mesh with the stiffness, in Pa")
      ->excludes(uniform);
  command->add_option("--poisson-ratio", options->poisson_ratio, "of the elastic models");
  command
      ->add_option("--regions", options->regions,
                   "a plan of the same mesh whose fixed vertices, handles and contact rows "
                   "replace all of the session's. If its handles have the same names "
                   "in the same order, open drags continue")
      ->type_name("PLAN");
  AddPlanOptions(command, &options->reading);
  command->add_option("--etag", options->etag,
                      "only if the session still has this etag (see session show)");
}

}  // namespace

std::string FullSessionName(const std::string& name) {
  return name.rfind("sessions/", 0) == 0 ? name : SessionName(name);
}

void AddSessionCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<SessionOptions>();
  CLI::App* command = app.add_subcommand(kSessionCommand.name, kSessionCommand.description);
  command->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, bool needs_name,
                       absl::Status (*run)(const SessionOptions&)) -> CLI::App* {
    CLI::App* sub = command->add_subcommand(name, what);
    if (needs_name) {
      sub->add_option("SESSION", options->name, "session name, with or without \"sessions/\"")
          ->required();
    }
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  add("list", "list all sessions, in memory or not", false, List);
  add("show", "show details", true, Show);
  AddUpdateOptions(add("update", "prepare a session again with another model, stiffness or regions",
                       true, Update),
                   options.get());
  add("delete", "delete one", true, Delete);
  command->footer("Example:\n  tissueform session list --server localhost:50051");
}

}  // namespace tissueform
