// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/uncertainty_experiment.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/lab/accuracy/accuracy_case_list.h"
#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/csv_table.h"
#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr double kPoissonRatio = 0.45;
constexpr int kSamples = 128;
// Below this a band is irrelevant (and its percentage means nothing).
constexpr double kLeastBandMm = 0.02;
constexpr double kNear = 0.15;
constexpr double kShownFactor = 2;

struct Model {
  DeformationModel model;
  const char* name;
  std::vector<double> factors;
};

// Each value of stiffness is a tissue.
MaterialUncertainty RangesOf(const Eigen::VectorXd& stiffness, double factor) {
  MaterialUncertainty ranges;
  std::map<double, int32_t> tissue_of;
  for (const double pa : stiffness) {
    const auto next = static_cast<int32_t>(tissue_of.size());
    const auto [found, added] = tissue_of.emplace(pa, next);
    if (added) ranges.tissues.push_back({absl::StrCat(pa, " Pa"), factor});
    ranges.tissue_of_tet.push_back(found->second);
  }
  return ranges;
}

struct Study {
  const AccuracyCase& problem;
  const Model& model;
  double factor = 1;
  MaterialUncertainty ranges;
  std::vector<int32_t> face;
  int threads = 1;
};

struct Answer {
  std::shared_ptr<MeshPreparation> preparation;
  Positions positions;
};

absl::StatusOr<Answer> Solve(const Study& study, const Eigen::VectorXd& stiffness,
                             const std::vector<int32_t>& node_order) {
  DeformerOptions options;
  options.model = study.model.model;
  options.preparation.poisson_ratio = kPoissonRatio;
  options.preparation.threads = study.threads;
  options.preparation.node_order = node_order;
  Answer answer;
  TF_ASSIGN_OR_RETURN(answer.preparation,
                      MeshPreparation::Create(study.problem.mesh, stiffness,
                                              study.problem.constraints, options.preparation));
  TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(answer.preparation, options));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform(study.problem.poses));
  if (!deformation.summary.converged) {
    return absl::InternalError(absl::StrCat(study.problem.name, " has not converged"));
  }
  answer.positions = std::move(deformation.positions);
  return answer;
}

// The 95th percentile of the distance over samples that are solved in full, of the face.
absl::StatusOr<Eigen::VectorXd> BandInFull(const Study& study, const Answer& middle) {
  const auto tissues = static_cast<int>(study.ranges.tissues.size());
  const Eigen::MatrixXd z = NormalSamples(kSamples, tissues);
  const double sigma = std::log(study.factor) / kNormal95;
  std::vector<std::vector<double>> distances(study.face.size());
  for (int s = 0; s < kSamples; ++s) {
    Eigen::VectorXd stiffness = study.problem.stiffness;
    for (Eigen::Index t = 0; t < stiffness.size(); ++t) {
      stiffness[t] *= std::exp(sigma * z(s, study.ranges.tissue_of_tet[static_cast<size_t>(t)]));
    }
    TF_ASSIGN_OR_RETURN(const Answer answer,
                        Solve(study, stiffness, middle.preparation->node_order()));
    for (size_t v = 0; v < study.face.size(); ++v) {
      distances[v].push_back(
          (answer.positions.row(study.face[v]) - middle.positions.row(study.face[v])).norm());
    }
  }
  Eigen::VectorXd band(static_cast<Eigen::Index>(study.face.size()));
  for (size_t v = 0; v < distances.size(); ++v) {
    band[static_cast<Eigen::Index>(v)] = Percentile(std::move(distances[v]), 95);
  }
  return band;
}

absl::StatusOr<AnswerExpansion> Expand(const Study& study, const Answer& answer) {
  if (study.model.model == DeformationModel::kNeoHookean) {
    return ExpandNeoHookean(answer.preparation.get(), study.ranges, answer.positions,
                            ExpansionOrder::kSecond);
  }
  const Positions moves = answer.positions - study.problem.mesh.positions();
  return ExpandLinearElastic(answer.preparation.get(), study.ranges,
                             Eigen::Map<const Eigen::VectorXd>(moves.data(), moves.size()),
                             ExpansionOrder::kSecond);
}

Eigen::VectorXd FirstOrder(const AnswerExpansion& expansion) {
  Eigen::MatrixXf fields(expansion.terms[0].field.rows(), expansion.variables);
  for (const auto& term : expansion.terms) {
    if (term.second == AnswerExpansion::kNone) {
      fields.col(term.first) = term.field.col(0).cast<float>();
    }
  }
  return FirstOrderBand(fields).cast<double>();
}

// In per cent of those where the band is no trifle.
double ShareNear(const Eigen::VectorXd& band, const Eigen::VectorXd& in_full) {
  int counted = 0;
  int near = 0;
  for (Eigen::Index v = 0; v < band.size(); ++v) {
    if (in_full[v] <= kLeastBandMm) continue;
    ++counted;
    if (std::abs(band[v] - in_full[v]) <= kNear * in_full[v]) ++near;
  }
  return counted == 0 ? 100 : 100.0 * near / counted;
}

absl::Status Draw(const Study& study, const Positions& positions, const Eigen::VectorXd& band_mm,
                  const ExperimentOptions& options) {
  const BoundarySurface skin = BoundaryOf(study.problem.mesh);
  const Eigen::VectorXd of_face = band_mm(study.face);
  const double high = std::ceil(100 * Percentile({of_face.begin(), of_face.end()}, 98)) / 100;
  std::vector<Scene> row;
  for (const View& view : study.problem.views) {
    SurfaceLayer layer;
    layer.positions = skin.Pick(positions);
    layer.triangles = skin.mesh.triangles();
    layer.vertex_values = band_mm(skin.vertices);
    layer.edges = false;
    Scene scene;
    scene.title =
        absl::StrFormat("%s, stiffness times or divided by %g", study.model.name, study.factor);
    scene.surfaces = {std::move(layer)};
    scene.colour_bar = {"mm, 95 % (darkest: or more)", 0, high};
    scene.view = view;
    row.push_back(std::move(scene));
  }
  Figure figure(
      absl::StrCat(study.problem.title, ": stiffness only; excludes model and surgical error"));
  figure.AddRow(560, std::move(row));
  return figure.WritePng(options.Path(
      absl::StrCat("uncertainty_", study.problem.name, "_", study.model.name, ".png")));
}

absl::Status Run(const Study& study, const ExperimentOptions& options, CsvTable* table) {
  options.Report(absl::StrFormat("%s, %s, factor %g: %d answers in full", study.problem.name,
                                 study.model.name, study.factor, kSamples));
  TF_ASSIGN_OR_RETURN(const Answer middle, Solve(study, study.problem.stiffness, {}));
  TF_ASSIGN_OR_RETURN(const AnswerExpansion expansion, Expand(study, middle));
  const Eigen::VectorXd band =
      SampleBand(expansion, SurfaceNormals(study.problem.mesh, middle.positions), study.threads)
          .size_mm;
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd in_full, BandInFull(study, middle));
  const Eigen::VectorXd of_face = band(study.face);
  const auto over = (in_full.array() > kLeastBandMm).count();
  table->AddRow({study.problem.name, study.model.name, Cell(study.factor),
                 absl::StrCat(study.face.size()), Cell(of_face.mean()), Cell(of_face.maxCoeff()),
                 Cell(in_full.mean()), Cell(in_full.maxCoeff()), absl::StrCat(over),
                 Cell(ShareNear(FirstOrder(expansion)(study.face), in_full)),
                 Cell(ShareNear(of_face, in_full))});
  return study.factor == kShownFactor ? Draw(study, middle.positions, band, options)
                                      : absl::OkStatus();
}

}  // namespace

absl::Status RunUncertaintyExperiment(const ExperimentOptions& options) {
  const Model models[] = {{DeformationModel::kLinearElastic, "linear_elastic", {2, 3}},
                          {DeformationModel::kNeoHookean, "neo_hookean", {2}}};
  CsvTable table({"case", "model", "factor_95", "face_vertices", "band_mean_mm", "band_max_mm",
                  "in_full_mean_mm", "in_full_max_mm", "vertices_over_0.02_mm",
                  "first_order_within_15_percent", "second_order_within_15_percent"});
  for (const char* name : {"head_chin", "head_mandible"}) {
    TF_ASSIGN_OR_RETURN(const AccuracyCase problem, CreateAccuracyCase(name, options.find_plan));
    const SkinPlace* face = FindPlace(problem.places, "face");
    if (face == nullptr) {
      return absl::NotFoundError(absl::StrCat("the mesh of ", name, " does not name a face"));
    }
    for (const Model& model : models) {
      for (const double factor : model.factors) {
        const Study study{problem,        model,
                          factor,         RangesOf(problem.stiffness, factor),
                          face->vertices, options.threads};
        TF_RETURN_IF_ERROR(Run(study, options, &table));
      }
    }
  }
  return table.WriteCsv(options.Path("uncertainty.csv"));
}

}  // namespace tissueform
