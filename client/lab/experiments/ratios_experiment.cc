// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/ratios_experiment.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/outcome/face_points.h"
#include "core/planning/outcome/published_ratios.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

constexpr char kOutside[] = " outside";
// Rounding of the printed ratios is not "outside".
constexpr double kRoundingOfRatios = 0.005;

constexpr std::array<DeformationModel, 3> kModels = {DeformationModel::kLinearElastic,
                                                     DeformationModel::kNeoHookean,
                                                     DeformationModel::kGradientField};

struct Operation {
  JawMove move;
  const char* name;
  const char* segment;     // that has to be there
  bool with_chin = false;  // a chin of its own goes along
  double forward_mm = 0;
  double up_mm = 0;
  std::vector<std::string> points;
};

const std::vector<Operation>& Operations() {
  static const auto* const kOperations = new std::vector<Operation>{
      {JawMove::kMandibleForward,
       "mandible 6 mm forward",
       "mandible",
       true,
       6,
       0,
       {"labrale_inferius", "sublabiale", "soft_pogonion", "labrale_superius"}},
      {JawMove::kMandibleBack,
       "mandible 6 mm back",
       "mandible",
       true,
       -6,
       0,
       {"labrale_superius", "stomion", "cheilion", "labrale_inferius", "sublabiale",
        "soft_pogonion"}},
      {JawMove::kMaxillaForward,
       "maxilla 6 mm forward",
       "maxilla",
       false,
       6,
       0,
       {"pronasale", "subnasale", "labrale_superius", "stomion"}},
      {JawMove::kMaxillaUp,
       "maxilla 4 mm up",
       "maxilla",
       false,
       0,
       4,
       {"subnasale", "labrale_superius", "stomion"}},
      {JawMove::kChinForward,
       "chin 6 mm forward",
       "chin",
       false,
       6,
       0,
       {"labrale_inferius", "sublabiale", "soft_pogonion"}}};
  return *kOperations;
}

// One plan, with contact or without.
struct Head {
  PlanProblem problem;
  ViewerFile viewer;
  std::vector<FacePoint> points;
};

// The ratios of one column of the table by operation and point.
using Ratios = std::map<std::pair<const Operation*, std::string>, double>;

bool HasHandle(const PlanProblem& problem, const std::string& name) {
  return std::ranges::any_of(problem.constraints.handles(),
                             [&](const HandleRegion& handle) { return handle.name == name; });
}

Vector3d MoveOf(const Operation& operation, const HeadFrame& frame) {
  return -operation.forward_mm * frame.posterior + operation.up_mm * frame.superior;
}

std::vector<HandlePose> PosesOf(const Operation& operation, const Head& head) {
  std::vector<HandlePose> poses;
  for (const HandleRegion& handle : head.problem.constraints.handles()) {
    HandlePose pose;
    if (handle.name == operation.segment || (operation.with_chin && handle.name == "chin")) {
      pose.translation_mm = MoveOf(operation, head.viewer.head_frame);
    }
    poses.push_back(pose);
  }
  return poses;
}

absl::StatusOr<Ratios> RatiosOf(const Head& head, DeformationModel model,
                                const std::shared_ptr<MeshPreparation>& preparation) {
  DeformerOptions options = head.problem.deformer;
  options.model = model;
  TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(preparation, options));
  Ratios ratios;
  for (const Operation& operation : Operations()) {
    if (!HasHandle(head.problem, operation.segment)) continue;
    TF_ASSIGN_OR_RETURN(const Deformation answer, deformer->Deform(PosesOf(operation, head)));
    // An answer that is not whole has no ratio.
    if (answer.summary.load < 1) continue;
    const Positions displacements = answer.positions - head.problem.mesh->positions();
    const Vector3d bone_mm = MoveOf(operation, head.viewer.head_frame);
    for (const FacePoint& point : head.points) {
      ratios[{&operation, point.name}] = MovementRatio(MovementOf(point, displacements), bone_mm);
    }
  }
  return ratios;
}

std::string RatioCell(const std::optional<double>& ratio,
                      const std::optional<PublishedRatio>& published) {
  if (!ratio) return "-";
  const bool outside =
      published && published->IsRange() &&
      (*ratio < published->low - kRoundingOfRatios || *ratio > published->high + kRoundingOfRatios);
  return absl::StrCat(absl::StrFormat("%.2f", *ratio), outside ? kOutside : "");
}

std::string PublishedCell(const std::optional<PublishedRatio>& published) {
  if (!published) return "-";
  if (!published->IsRange()) return absl::StrFormat("about %.2f", published->low);
  return absl::StrFormat("%.2f to %.2f", published->low, published->high);
}

std::optional<double> Find(const Ratios& ratios, const Operation& operation,
                           const std::string& point) {
  const auto found = ratios.find({&operation, point});
  if (found == ratios.end()) return std::nullopt;
  return found->second;
}

// Columns: each model, sticking and with contact.
void AddRows(const std::string& head, const std::vector<Ratios>& columns, CsvTable* table) {
  for (const Operation& operation : Operations()) {
    for (const std::string& point : operation.points) {
      const auto published = FindPublishedRatio(operation.move, point);
      std::vector<std::string> cells = {head, operation.name, point, PublishedCell(published)};
      bool any = false;
      for (const Ratios& ratios : columns) {
        const std::optional<double> ratio = Find(ratios, operation, point);
        any = any || ratio;
        cells.push_back(RatioCell(ratio, published));
      }
      if (any) table->AddRow(std::move(cells));
    }
  }
}

absl::StatusOr<ViewerFile> ViewerOf(const std::string& mesh_path) {
  const std::filesystem::path folder = std::filesystem::path(mesh_path).parent_path();
  return ReadViewer((folder / kViewerFile).string());
}

// The column of each model on one head; empty ratios where the plan has no contact.
absl::Status AddColumns(const Plan& plan, const ViewerFile& viewer, bool contact, int threads,
                        std::vector<Ratios>* columns) {
  if (contact && plan.contact.empty()) {
    columns->resize(columns->size() + kModels.size());
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(const PlanProblem with_rows, ResolvePlan(plan));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan, {.contact = contact}));
  problem.deformer.preparation.threads = threads;
  const std::vector<FacePoint> points =
      FacePointsOf(problem, viewer, with_rows.constraints.contact());
  const Head head{std::move(problem), viewer, points};
  TF_ASSIGN_OR_RETURN(
      const auto preparation,
      MeshPreparation::Create(*head.problem.mesh, head.problem.stiffness, head.problem.constraints,
                              head.problem.deformer.preparation));
  for (const DeformationModel model : kModels) {
    TF_ASSIGN_OR_RETURN(Ratios ratios, RatiosOf(head, model, preparation));
    columns->push_back(std::move(ratios));
  }
  return absl::OkStatus();
}

// The word that marks a figure is red where a person looks.
std::string Colored(const std::string& text) {
  if (isatty(STDOUT_FILENO) == 0) return text;
  return absl::StrReplaceAll(text, {{kOutside, absl::StrCat("\033[31m", kOutside, "\033[0m")}});
}

// Bundled plans with landmarks.
constexpr std::array<const char*, 2> kBundled = {"head", "three_segments"};

}  // namespace

CsvTable RatioTable() {
  std::vector<std::string> header = {"head", "operation", "point", "published"};
  for (const char* tissue : {"sticking", "contact"}) {
    for (const DeformationModel model : kModels) {
      header.push_back(absl::StrCat(TraitsOf(model).name, " ", tissue));
    }
  }
  return CsvTable(std::move(header));
}

absl::Status AddRatiosOfPlan(const std::string& head, const std::string& plan_path, int threads,
                             CsvTable* table) {
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(plan_path));
  TF_ASSIGN_OR_RETURN(const ViewerFile viewer, ViewerOf(plan.mesh_path));
  std::vector<Ratios> columns;
  for (const bool contact : {false, true}) {
    TF_RETURN_IF_ERROR(AddColumns(plan, viewer, contact, threads, &columns));
  }
  AddRows(head, columns, table);
  return absl::OkStatus();
}

absl::Status RunRatiosExperiment(const ExperimentOptions& options) {
  SetBlasThreads(1);
  CsvTable table = RatioTable();
  for (const char* name : kBundled) {
    options.Report(absl::StrCat("ratios: ", name));
    TF_ASSIGN_OR_RETURN(const std::string path, options.find_plan(name));
    TF_RETURN_IF_ERROR(AddRatiosOfPlan(name, path, options.threads, &table));
  }
  for (const std::string& path : options.plans) {
    // The folder of a plan may be named after a patient, so the table counts them.
    const std::string name = absl::StrCat("plan ", 1 + (&path - options.plans.data()));
    options.Report(absl::StrCat("ratios: ", name));
    TF_RETURN_IF_ERROR(AddRatiosOfPlan(name, path, options.threads, &table));
  }
  absl::PrintF("%s", Colored(table.Markdown()));
  return table.WriteCsv(options.Path("ratios.csv"));
}

}  // namespace tissueform
