// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/model_settings.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"

namespace tissueform {
namespace {

// Of one stiffness for all tissue to twice the plan's differences, as logarithms.
constexpr double kContrasts[] = {1, 0, 0.5, 1.5, 2};
// The plan's depth is 10 mm unless its recipe says otherwise; at 0 tissue sticks to all bone.
constexpr double kVestibulesMm[] = {0, 4, 7};

bool HasContrast(const PlanProblem& problem) {
  return problem.stiffness.minCoeff() < problem.stiffness.maxCoeff();
}

// #V: whether a row of contact between the lips names the vertex.
std::vector<bool> OnSeam(const PlanProblem& problem) {
  std::vector<bool> on_seam(static_cast<size_t>(problem.mesh->num_vertices()), false);
  for (const ContactRow& row : problem.constraints.contact()) {
    if (row.other == ContactRow::kBone) continue;
    on_seam[static_cast<size_t>(row.vertex)] = true;
    on_seam[static_cast<size_t>(row.other)] = true;
  }
  return on_seam;
}

Positions SeamPositions(const PlanProblem& problem, const std::vector<bool>& on_seam) {
  Positions seam(std::ranges::count(on_seam, true), 3);
  Eigen::Index row = 0;
  for (size_t v = 0; v < on_seam.size(); ++v) {
    if (on_seam[v]) seam.row(row++) = problem.mesh->positions().row(static_cast<Eigen::Index>(v));
  }
  return seam;
}

// #V: of the vertices that touch bone, those that stick with this vestibule.
std::vector<bool> StickingAgain(const PlanProblem& problem, double vestibule_mm) {
  const std::vector<bool> on_seam = OnSeam(problem);
  const Positions seam = SeamPositions(problem, on_seam);
  std::vector<bool> sticks(on_seam.size(), false);
  for (const FreedVertex& freed : problem.freed) {
    const auto place = problem.mesh->positions().row(freed.vertex);
    const bool is_near =
        seam.rows() > 0 &&
        (seam.rowwise() - place).rowwise().squaredNorm().minCoeff() <= vestibule_mm * vestibule_mm;
    const auto v = static_cast<size_t>(freed.vertex);
    sticks[v] = !is_near && !on_seam[v];
  }
  return sticks;
}

}  // namespace

std::vector<ModelSettings> SettingsToTry(const PlanProblem& problem) {
  std::vector<std::optional<double>> vestibules = {std::nullopt};
  if (!problem.freed.empty()) {
    vestibules.insert(vestibules.end(), std::begin(kVestibulesMm), std::end(kVestibulesMm));
  }
  std::vector<ModelSettings> settings;
  for (const double contrast : kContrasts) {
    if (contrast != 1 && !HasContrast(problem)) continue;
    for (const std::optional<double>& vestibule : vestibules) {
      settings.push_back({.stiffness_contrast = contrast, .vestibule_mm = vestibule});
      if (!problem.lip_edge) continue;
      settings.push_back({.stiffness_contrast = contrast, .vestibule_mm = vestibule, .seal = true});
    }
  }
  return settings;
}

Eigen::VectorXd WithContrast(const Eigen::VectorXd& stiffness, double contrast) {
  if (contrast == 1) return stiffness;
  const Eigen::ArrayXd logarithms = stiffness.array().log();
  const double mean = logarithms.mean();
  return (mean + contrast * (logarithms - mean)).exp();
}

ConstraintSet WithVestibule(const PlanProblem& problem, double vestibule_mm) {
  const std::vector<bool> sticks = StickingAgain(problem, vestibule_mm);
  std::vector<int32_t> fixed = problem.constraints.fixed();
  std::vector<HandleRegion> handles = problem.constraints.handles();
  for (const FreedVertex& freed : problem.freed) {
    if (!sticks[static_cast<size_t>(freed.vertex)]) continue;
    const bool of_fixed = freed.region == ConstraintSet::kFixed;
    (of_fixed ? fixed : handles[static_cast<size_t>(freed.region)].vertices)
        .push_back(freed.vertex);
  }
  std::vector<ContactRow> contact;
  for (const ContactRow& row : problem.constraints.contact()) {
    if (!sticks[static_cast<size_t>(row.vertex)]) contact.push_back(row);
  }
  // The vertices were free, each is in one region, and no row names one: nothing can be refused.
  return *ConstraintSet::Create(*problem.mesh, std::move(fixed), std::move(handles),
                                std::move(contact));
}

absl::Status SettingsDeformer::Prepare(const ModelSettings& settings) {
  ModelSettings wanted = settings;
  wanted.seal = false;  // it shares the preparation
  if (preparation_ != nullptr && wanted == prepared_for_) return absl::OkStatus();
  preparation_ = nullptr;  // before the next one takes memory
  const ConstraintSet constraints = settings.vestibule_mm
                                        ? WithVestibule(problem_, *settings.vestibule_mm)
                                        : problem_.constraints;
  PreparationOptions options = problem_.deformer.preparation;
  options.threads = threads_;
  TF_ASSIGN_OR_RETURN(
      preparation_,
      MeshPreparation::Create(*problem_.mesh,
                              WithContrast(problem_.stiffness, settings.stiffness_contrast),
                              constraints, options));
  prepared_for_ = wanted;
  return absl::OkStatus();
}

absl::StatusOr<Deformation> SettingsDeformer::Deform(const ModelSettings& settings,
                                                     const std::vector<HandlePose>& poses) {
  TF_RETURN_IF_ERROR(Prepare(settings));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                      settings.seal ? CreateSealedLipsDeformer(preparation_, *problem_.lip_edge)
                                    : CreateLinearElasticDeformer(preparation_));
  return deformer->Deform(poses);
}

}  // namespace tissueform
