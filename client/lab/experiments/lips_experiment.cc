// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/lips_experiment.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/lab/accuracy/accuracy_case_list.h"
#include "client/lab/accuracy/accuracy_models.h"
#include "client/lab/accuracy/calculix.h"
#include "client/lab/accuracy/contact_cases.h"
#include "client/lab/experiments/calculix_folder.h"
#include "core/base/csv_table.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/model.h"
#include "core/mechanics/linear_solvers/blas_threads.h"

namespace tissueform {
namespace {

constexpr double kHeadPoissonRatio = 0.45;
constexpr double kNewtonsPerUnit = 1e-6;  // Pa mm^2

// One problem twice: ours, and as CalculiX gets it.
struct Comparison {
  AccuracyCase problem;
  CalculixProblem of_calculix;
  DeformationModel model = DeformationModel::kLinearElastic;
};

absl::StatusOr<Deformation> DeformationOf(const Comparison& comparison) {
  const AccuracyCase& problem = comparison.problem;
  PreparationOptions options;
  options.poisson_ratio = comparison.of_calculix.poisson_ratio;
  TF_ASSIGN_OR_RETURN(const auto preparation,
                      MeshPreparation::Create(problem.mesh, problem.stiffness, problem.constraints,
                                              std::move(options)));
  DeformerOptions deformer_options;
  deformer_options.model = comparison.model;
  TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(preparation, deformer_options));
  return deformer->Deform(problem.poses);
}

absl::StatusOr<std::vector<Comparison>> AllComparisons(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(AccuracyCase blocks, TwoBlocks());
  TF_ASSIGN_OR_RETURN(AccuracyCase plate, BlockUnderPlate());
  TF_ASSIGN_OR_RETURN(CalculixProblem plate_surfaces, BlockUnderPlateForCalculix(plate));
  TF_ASSIGN_OR_RETURN(const AccuracyCase chin, CreateAccuracyCase("head_chin", options.find_plan));
  TF_ASSIGN_OR_RETURN(AccuracyCase head, WithContactRows(chin));
  CalculixProblem block_surfaces = TwoBlocksForCalculix(blocks);
  CalculixProblem head_rows = ForCalculix(head, kHeadPoissonRatio, CalculixLaw::kLinear);
  std::vector<Comparison> all;
  all.push_back({std::move(blocks), std::move(block_surfaces)});
  all.push_back({std::move(plate), std::move(plate_surfaces), DeformationModel::kNeoHookean});
  all.push_back({std::move(head), std::move(head_rows)});
  return all;
}

// What presses on the fixed end, ours as the sum of the rows' forces; without forces of CalculiX's
// nothing to compare.
std::string Forces(const Comparison& comparison, const Deformation& answer,
                   const CalculixResult& reference) {
  if (reference.forces.rows() == 0) return "";
  const double ours =
      std::accumulate(answer.contact.forces.begin(), answer.contact.forces.end(), 0.0);
  const double expected = reference.forces(comparison.of_calculix.constraints.fixed(), Eigen::all)
                              .colwise()
                              .sum()
                              .norm();
  return absl::StrFormat("%.6f of %.6f", kNewtonsPerUnit * ours, kNewtonsPerUnit * expected);
}

absl::Status AddRow(const Comparison& comparison, const std::string& scratch, CsvTable* table) {
  const AccuracyCase& problem = comparison.problem;
  TF_ASSIGN_OR_RETURN(const CalculixResult reference, RunCalculix(comparison.of_calculix, scratch));
  TF_ASSIGN_OR_RETURN(const Deformation answer, DeformationOf(comparison));
  const auto open = std::ranges::count(answer.contact.forces, 0.0);
  const double largest_mm =
      (reference.deformed - problem.mesh.positions()).rowwise().norm().maxCoeff();
  const double distance_mm = (answer.positions - reference.deformed).rowwise().norm().maxCoeff();
  table->AddRow({problem.name, std::string(TraitsOf(comparison.model).name),
                 absl::StrCat(problem.constraints.contact().size()), absl::StrCat(open),
                 Cell(largest_mm), Cell(distance_mm), Cell(100 * distance_mm / largest_mm),
                 Forces(comparison, answer, reference)});
  return absl::OkStatus();
}

}  // namespace

absl::Status RunLipsExperiment(const ExperimentOptions& options) {
  SetBlasThreads(1);  // CalculiX gets one thread too
  TF_ASSIGN_OR_RETURN(const std::vector<Comparison> comparisons, AllComparisons(options));
  const CalculixFolder scratch(options.Path("lips_scratch"));
  CsvTable table({"case", "model", "rows", "open", "largest_mm", "distance_mm", "distance_percent",
                  "force_n_of_calculix"});
  for (const Comparison& comparison : comparisons) {
    options.Report(absl::StrCat("lips: ", comparison.problem.name));
    TF_RETURN_IF_ERROR(AddRow(comparison, scratch.path(), &table));
  }
  absl::PrintF("%s", table.Markdown());
  return table.WriteCsv(options.Path("lips.csv"));
}

}  // namespace tissueform
