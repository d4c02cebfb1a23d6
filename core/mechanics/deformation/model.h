// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/strings/string_view.h"
#include "absl/types/span.h"

namespace tissueform {

enum class DeformationModel { kGradientField, kArap, kLinearElastic, kNeoHookean };

// What the rest of the program has to know about a model. Code outside of this folder asks this
// table, never for one model by name, so that a new model is a new row (ARCHITECTURE.md, "Where to
// add what").
struct ModelTraits {
  DeformationModel model;
  absl::string_view name;  // in plans, recipes and options
  // An answer takes several linear solves (gradient_field: with estimated rotations, too).
  bool iterates;
  // Tissue is an elastic solid: the model shares the elastic factor, has strains and stresses, and
  // its answers have a band from the uncertainty of the material.
  bool is_elastic;
  // gradient_field: with propagated rotations and cotangent guidance only (HasPreparedAnswers).
  bool has_prepared_answers;
  // Also where tissue touches bone or other tissue (ConstraintSet::contact).
  bool has_prepared_contact;
};

// One row for each model, in the order in which users see them.
absl::Span<const ModelTraits> AllModels();

const ModelTraits& TraitsOf(DeformationModel model);

}  // namespace tissueform
