// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/accuracy/accuracy_case.h"
#include "client/lab/accuracy/calculix.h"
#include "core/mechanics/deformation/create_deformer.h"

namespace tissueform {

// A model with its settings, as it is compared.
struct ModelVariant {
  std::string name;   // in tables
  std::string title;  // in pictures
  DeformationModel model = DeformationModel::kGradientField;
  RotationMode rotation = RotationMode::kPropagated;  // of the gradient field
  bool uses_poisson_ratio = false;
  bool is_prepared = false;  // by its prepared answers, as a drag shows them
};

// Plain Poisson, both modes of the gradient field, ARAP, linear elasticity, neo-Hookean by its
// prepared answers and by itself.
const std::vector<ModelVariant>& AllModelVariants();

// What one model, or CalculiX, made of a case.
struct ModelAnswer {
  std::string name;
  Positions positions;
  double seconds = 0;  // from the mesh to the answer, one thread
  Eigen::Index inverted_tets = 0;
  bool converged = true;
};

// The answer from nothing: no model profits from what another one prepared.
absl::StatusOr<ModelAnswer> AnswerByModel(const ModelVariant& variant, const AccuracyCase& problem,
                                          double poisson_ratio);

// The case as CalculiX gets it, with gap elements for contact rows; forces and stresses not asked
// for.
CalculixProblem ForCalculix(const AccuracyCase& problem, double poisson_ratio, CalculixLaw law);

// "calculix_linear" or "calculix_neo_hookean". Errors: those of RunCalculix.
absl::StatusOr<ModelAnswer> AnswerByCalculix(CalculixLaw law, const AccuracyCase& problem,
                                             double poisson_ratio, const std::string& folder);

}  // namespace tissueform
