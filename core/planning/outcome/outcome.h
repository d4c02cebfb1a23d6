// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mechanics/deformation/model.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/outcome/head_registration.h"
#include "core/planning/outcome/model_settings.h"
#include "core/planning/outcome/outcome_landmarks.h"
#include "core/planning/outcome/real_movement.h"
#include "core/planning/outcome/skin_comparison.h"

namespace tissueform {

struct OutcomeOptions {
  std::vector<DeformationModel> models;  // at least one
  int threads = 1;                       // the result does not depend on it
  // Findings that make a comparison doubtful become cautions instead of errors: an open mouth,
  // swelling. What cannot be compared at all stays an error.
  bool accept_findings = false;
  bool settings = false;  // also Outcome::by_settings
  // Gets what begins. May be empty.
  std::function<void(absl::string_view stage)> on_stage = {};
};

// One predicted face against the operated one, in the pre-operative coordinates, LPS, mm.
struct ComparedPrediction {
  std::string model;     // by its name in plans; "none" for the pre-operative face
  std::string movement;  // "real", "planned" or "none"
  ComparedFace face;
  std::vector<RegionComparison> regions;
  std::vector<LandmarkComparison> landmarks;
  double load = 1;  // SolveSummary::load
};

// The answer of linear_elastic with other settings, from the movement of Outcome::predictions[0].
struct SettingsComparison {
  ModelSettings settings;
  std::vector<RegionComparison> regions;
};

struct Outcome {
  bool by_bone = false;  // what the scans were registered by, and whether segments were measured
  HeadRegistration registration;
  std::vector<SegmentMovement> segments;
  std::optional<MouthOpening> opening;  // added to the planned poses for their predictions
  // From the real movement first, then from the planned one, then the baseline without a movement.
  std::vector<ComparedPrediction> predictions;
  std::vector<SettingsComparison> by_settings;
  std::vector<LandmarkComparison> by_ratios;  // the baseline of published ratios, real movement
  TriangleMesh real_skin;                     // pre-operative coordinates
  // By which the operated face exceeds the first prediction within the regions.
  double excess_ml = 0;
  std::vector<std::string> cautions;
};

// Compares what the models predict for a case with the head after the operation. `problem` and
// `contents` are of one plan.
//
// Errors: those of RegisterHead, MeshPreparation::Create, CreateDeformer and SettingsDeformer;
// InvalidArgument for a case without regions of skin. FailedPrecondition where nothing has moved
// (the post-operative scan is the pre-operative one), and, unless accepted, for an opened mouth and
// for swelling.
absl::StatusOr<Outcome> CompareOutcome(const PlanProblem& problem, const CaseFile& contents,
                                       const PostOperativeHead& post,
                                       const OutcomeOptions& options);

}  // namespace tissueform
