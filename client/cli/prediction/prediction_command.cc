// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/prediction_command.h"

#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/compare/comparison_report.h"
#include "client/cli/prediction/prediction_export.h"
#include "client/cli/prediction/prediction_pictures.h"
#include "client/cli/prediction/prediction_send_command.h"
#include "client/cli/session/model_option.h"
#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/session/session_command.h"
#include "client/cli/session/session_wait.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/stats_json.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/atomic_file.h"
#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_io.h"
#include "core/planning/rendering/virtual_display.h"
#include "proto/conversion/answer_conversion.h"

namespace tissueform {
namespace {

struct PredictionOptions {
  ServerConnection server;
  std::string name;
  std::string plan;
  PlanReadOptions reading;
  std::string session;
  std::string model;
  std::string other;
  std::string mesh;
  std::string out;
  std::string pictures;  // a folder
  bool json = false;
  bool skin = false;
  std::string vertices;  // a file
  std::string case_name;
  std::string title;

  PredictionLabel Label() const { return {.case_name = FullCase(), .title = title}; }
  std::string FullCase() const { return case_name.empty() ? "" : FullName("cases", case_name); }
  std::string FullPrediction() const { return FullName("predictions", name); }
};

// Where a session's hand was last lifted.
absl::StatusOr<std::vector<NamedPose>> CommittedPoses(TissueformClient* client,
                                                      const std::string& session) {
  TF_ASSIGN_OR_RETURN(const v1::Session described, client->GetSession(session));
  std::vector<NamedPose> poses;
  for (const v1::HandlePose& pose : described.committed_poses()) {
    poses.push_back(ToNamedPose(pose));
  }
  if (poses.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(session, " has no committed pose; name a plan with poses"));
  }
  return poses;
}

// By the plan in a session of its own, in the session that is named, or at that one's own poses.
absl::StatusOr<v1::Prediction> MakePrediction(const PredictionOptions& options,
                                              TissueformClient* client) {
  TF_ASSIGN_OR_RETURN(const v1::DeformationModel model, ModelOf(options.model));
  const std::string session = FullSessionName(options.session);
  if (options.plan.empty()) {
    TF_ASSIGN_OR_RETURN(const std::vector<NamedPose> poses, CommittedPoses(client, session));
    return client->predictions().Create(session, poses, model, "", options.Label());
  }
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.plan, options.reading));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  if (!options.session.empty()) {
    return client->predictions().Create(session, NamedPoses(problem), model, "", options.Label());
  }
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PlanSession> own,
                      MakePlanSession(client, problem, /*stop=*/nullptr));
  return client->predictions().Create(own->name(), NamedPoses(problem), model, "", options.Label());
}

absl::Status Create(const PredictionOptions& options) {
  if (options.plan.empty() && options.session.empty()) {
    return absl::InvalidArgumentError("name a plan, a session (--session), or both");
  }
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::Prediction prediction, MakePrediction(options, client.get()));
  absl::PrintF("%s\n", prediction.name());
  absl::PrintF("%s, %d vertices, largest movement %.3g mm, %d tets inverted; %s\n",
               ModelText(prediction.model()), prediction.vertex_count(),
               prediction.quality().max_displacement_mm(),
               prediction.quality().inverted_tet_count(), "the server stores it");
  const std::string not_reached = NotReachedText(ToSolveSummary(prediction.summary()));
  if (!not_reached.empty()) absl::FPrintF(stderr, "warning: %s\n", not_reached);
  return absl::OkStatus();
}

absl::Status List(const PredictionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const std::string session = options.session.empty() ? "" : FullSessionName(options.session);
  TF_ASSIGN_OR_RETURN(const std::vector<v1::Prediction> predictions,
                      client->predictions().List(session, options.FullCase()));
  absl::PrintF("%-46s %-16s %-20s %9s %9s %-24s %s\n", "prediction", "model", "made", "max mm",
               "inverted", "handles", "title");
  for (const v1::Prediction& prediction : predictions) {
    const auto add_handle = [](std::string* text, const v1::HandlePose& pose) {
      *text += pose.handle();
    };
    absl::PrintF("%-46s %-16s %-20s %9.3g %9d %-24s %s\n", prediction.name(),
                 ModelText(prediction.model()), TimeText(prediction.create_time()),
                 prediction.quality().max_displacement_mm(),
                 prediction.quality().inverted_tet_count(),
                 absl::StrJoin(prediction.poses(), ", ", add_handle), prediction.title());
  }
  absl::PrintF("%d predictions\n", predictions.size());
  return absl::OkStatus();
}

absl::Status Show(const PredictionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::Prediction prediction,
                      client->predictions().Get(options.FullPrediction()));
  PrintReport(options.json, prediction.DebugString(), ProvenanceJson(prediction));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<int32_t>> ReadVertexNumbers(const std::string& path) {
  std::ifstream file(path);
  if (!file) return absl::NotFoundError(absl::StrCat(path, ": cannot be read"));
  std::vector<int32_t> vertices;
  for (std::string word; file >> word;) {
    int32_t vertex = 0;
    if (!absl::SimpleAtoi(word, &vertex)) {
      return absl::InvalidArgumentError(absl::StrCat(
          path, ": \"", word, "\" is not a vertex; write numbers from 0, separated by spaces"));
    }
    vertices.push_back(vertex);
  }
  if (vertices.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": no vertices; write numbers from 0, separated by spaces"));
  }
  return vertices;
}

absl::StatusOr<AnswerVertices> ComparedVertices(const PredictionOptions& options) {
  if (options.skin) return AnswerVertices{AnswerVertices::Kind::kSkin, {}};
  if (options.vertices.empty()) return AnswerVertices{};
  TF_ASSIGN_OR_RETURN(std::vector<int32_t> list, ReadVertexNumbers(options.vertices));
  return AnswerVertices{AnswerVertices::Kind::kList, std::move(list)};
}

absl::Status Compare(const PredictionOptions& options) {
  if (options.other.empty() == options.model.empty()) {
    return absl::InvalidArgumentError("name another prediction, or a model (--model)");
  }
  TF_ASSIGN_OR_RETURN(const v1::DeformationModel model, ModelOf(options.model));
  PredictionCalls::Other other = model;
  if (!options.other.empty()) other = FullName("predictions", options.other);
  TF_ASSIGN_OR_RETURN(const AnswerVertices vertices, ComparedVertices(options));
  const char* where = options.skin ? "skin" : options.vertices.empty() ? "all" : "listed";
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const ComparedPredictions compared,
                      client->predictions().Compare(options.FullPrediction(), other,
                                                    /*differences=*/false, vertices));
  const v1::PredictionComparison& comparison = compared.comparison;
  const DistanceSummary distances = ToDistanceSummary(comparison.distances());
  if (options.json) {
    PrintJsonReport({{"prediction", comparison.prediction()},
                     {"model", ModelText(comparison.model())},
                     {"other_prediction", comparison.other_prediction()},
                     {"other_model", ModelText(comparison.other_model())},
                     {"vertices", where},
                     {"distances", DistancesToJson(distances)},
                     {"worst_vertex", comparison.distances().worst_vertex()}});
    return absl::OkStatus();
  }
  absl::PrintF(
      "%s (%s) and %s (%s), in mm\n", comparison.prediction(), ModelText(comparison.model()),
      comparison.other_prediction().empty() ? "its session now" : comparison.other_prediction(),
      ModelText(comparison.other_model()));
  PrintDistanceHeadline();
  PrintDistances({{where, distances}});
  absl::PrintF("farthest at vertex %d\n", comparison.distances().worst_vertex());
  return absl::OkStatus();
}

absl::StatusOr<std::optional<PredictionMesh>> ReadGeometry(const PredictionOptions& options,
                                                           const v1::Prediction& prediction) {
  std::optional<PredictionMesh> mesh;
  if (!options.plan.empty()) {
    TF_ASSIGN_OR_RETURN(mesh, ReadPlanOf(prediction, options.plan, options.reading));
  } else if (!options.mesh.empty()) {
    TF_ASSIGN_OR_RETURN(mesh, ReadMeshOf(prediction, options.mesh));
  }
  return mesh;
}

absl::Status CheckExportGoals(const PredictionOptions& options) {
  if (options.out.empty() && options.pictures.empty()) {
    return absl::InvalidArgumentError(
        "name a file (--out), a folder for pictures (--png), or both");
  }
  if (!options.pictures.empty()) TF_RETURN_IF_ERROR(CheckFillable(options.pictures));
  return options.out.empty() ? absl::OkStatus() : CheckWritable(options.out);
}

absl::Status Export(const PredictionOptions& options) {
  TF_RETURN_IF_ERROR(CheckExportGoals(options));
  std::unique_ptr<VirtualDisplay> display;  // before gRPC has threads
  if (!options.pictures.empty()) {
    TF_ASSIGN_OR_RETURN(display, VirtualDisplay::Open());
  }
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  PredictionCalls& calls = client->predictions();
  TF_ASSIGN_OR_RETURN(const v1::Prediction prediction, calls.Get(options.FullPrediction()));
  TF_ASSIGN_OR_RETURN(const std::optional<PredictionMesh> mesh, ReadGeometry(options, prediction));
  TF_ASSIGN_OR_RETURN(const Positions positions, calls.ReadPositions(prediction.name()));
  const PredictionMesh* named = mesh.has_value() ? &*mesh : nullptr;
  if (!options.pictures.empty()) {
    TF_ASSIGN_OR_RETURN(const CaseFile contents, ShownCase(named, prediction, client.get()));
    TF_RETURN_IF_ERROR(WritePicturesOf(options.pictures, prediction, contents, positions));
    absl::PrintF("%s: %s in %s\n", prediction.name(), absl::StrJoin(BeforeAndAfterPictures(), ", "),
                 options.pictures);
  }
  if (options.out.empty()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(ExportPrediction(options.out, prediction, named, positions));
  absl::PrintF("wrote %s to %s\n", prediction.name(), options.out);
  return absl::OkStatus();
}

absl::Status Delete(const PredictionOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_RETURN_IF_ERROR(client->predictions().Delete(options.FullPrediction()));
  absl::PrintF("deleted %s\n", options.FullPrediction());
  return absl::OkStatus();
}

}  // namespace

void AddPredictionCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<PredictionOptions>();
  CLI::App* command = app.add_subcommand(kPredictionCommand.name, kPredictionCommand.description);
  command->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, bool needs_name,
                       absl::Status (*run)(const PredictionOptions&)) {
    CLI::App* sub = command->add_subcommand(name, what);
    if (needs_name) {
      sub->add_option("PREDICTION", options->name,
                      "prediction name, with or without \"predictions/\"")
          ->required();
    }
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  CLI::App* create = add("create", "predict and store the answer on the server", false, Create);
  create->add_option("PLAN", options->plan, "plan with the poses");
  create->add_option("--session", options->session,
                     "session to predict with; without a plan, at its committed poses");
  AddModelOption(create, "use this model instead of the session's", &options->model);
  create->add_option("--title", options->title, "title in lists");
  create->add_option("--case", options->case_name, "the case that it belongs to");
  AddPlanOptions(create, &options->reading);

  CLI::App* list = add("list", "all predictions", false, List);
  list->add_option("--session", options->session, "only predictions of this session");
  list->add_option("--case", options->case_name, "only predictions of this case");
  add("show", "show details", true, Show)->add_flag("--json", options->json, "as JSON");

  CLI::App* compare = add("compare", "distance to another one, in mm", true, Compare);
  compare->add_option("OTHER", options->other, "the other prediction, of the same mesh");
  AddModelOption(compare, "instead of OTHER: this model's answer in the session of PREDICTION",
                 &options->model);
  CLI::Option* skin = compare->add_flag("--skin", options->skin,
                                        "only vertices on the surface (the server needs the mesh)");
  compare
      ->add_option("--vertices", options->vertices,
                   "only the vertices with the numbers, from 0, in this text file")
      ->type_name("FILE")
      ->excludes(skin);
  compare->add_flag("--json", options->json, "as JSON");

  CLI::App* save = add("export", "write a prediction to a file, or as pictures", true, Export);
  save->add_option("--out", options->out,
                   "OUT.vtu: the deformed mesh; OUT.stl or OUT.ply: its surface, each with its "
                   "provenance in OUT.vtu.json and so on; OUT.json: provenance and positions");
  save->add_option("--png", options->pictures,
                   "an empty or new folder: before and after from the front, from the "
                   "left and between, of its case, or of --plan or --mesh")
      ->type_name("FOLDER");
  CLI::Option* plan = save->add_option("--plan", options->plan, "the plan it was made from");
  save->add_option("--mesh", options->mesh, "the mesh file it was made from")->excludes(plan);
  AddPlanOptions(save, &options->reading);
  add("delete", "delete one", true, Delete);
  AddPredictionSendCommands(*command, work);
  command->footer(
      "Examples:\n"
      "  tissueform prediction create plan.json --server localhost:50051\n"
      "  tissueform prediction export ID --plan plan.json --out after.vtu --server "
      "localhost:50051\n"
      "  tissueform prediction export ID --png pictures --server localhost:50051");
}

}  // namespace tissueform
