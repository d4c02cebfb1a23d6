// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What operated patients can calibrate of the model linear_elastic. Bones prescribe displacements,
// so one factor on all stiffness changes no face: what counts is how much tissues differ.
struct ModelSettings {
  // Young's modulus of each tet becomes E^contrast, up to a common factor: 0 is one stiffness for
  // all tissue, 1 that of the plan.
  double stiffness_contrast = 1;
  // Tissue on bone farther than this from the lips' seam sticks; empty: as in the plan.
  std::optional<double> vestibule_mm = {};
  bool seal = false;  // LipSeal

  friend bool operator==(const ModelSettings&, const ModelSettings&) = default;
};

// The settings that a plan can be predicted with, the plan's own first; those with equal stiffness
// and vestibule follow each other. A plan with one stiffness has no contrast to vary, a plan
// without contact no vestibule and no seal.
std::vector<ModelSettings> SettingsToTry(const PlanProblem& problem);

// #T, positive; the geometric mean stays. REQUIRES: positive values.
Eigen::VectorXd WithContrast(const Eigen::VectorXd& stiffness, double contrast);

// The plan's constraints, but tissue farther than `vestibule_mm` from the nearest vertex of the
// seam sticks to its bone again, and its rows of contact are left out. The seam stays free.
ConstraintSet WithVestibule(const PlanProblem& problem, double vestibule_mm);

// Answers of linear_elastic with any settings of SettingsToTry. Keeps what the last answer was
// prepared with. One thread at a time. `problem` must outlive it.
class SettingsDeformer {
 public:
  SettingsDeformer(const PlanProblem& problem, int threads)
      : problem_(problem), threads_(threads) {}

  // One pose a handle of the problem. Errors: those of MeshPreparation::Create,
  // CreateLinearElasticDeformer, CreateSealedLipsDeformer and Deformer::Deform.
  absl::StatusOr<Deformation> Deform(const ModelSettings& settings,
                                     const std::vector<HandlePose>& poses);

 private:
  absl::Status Prepare(const ModelSettings& settings);

  const PlanProblem& problem_;
  const int threads_;
  ModelSettings prepared_for_;
  std::shared_ptr<MeshPreparation> preparation_;
};

}  // namespace tissueform
