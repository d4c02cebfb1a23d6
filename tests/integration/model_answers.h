// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>

#include "absl/status/status.h"

#include "core/base/types.h"
#include "proto/conversion/session_conversion.h"
#include "tests/integration/service_test.h"
#include "tissueform/v1/session.pb.h"

// The meshes that the model-based test works with, and what poses do to them.
namespace tissueform::testing {

// The meshes of a model, by number: the same bar with other positions and another stiffness, so
// that vertices and regions alone do not distinguish them.
inline constexpr int kModelMeshes = 2;
const BarProblem& MeshOfModel(int mesh);
// "meshes/{sha256}"
const std::string& NameOfMesh(int mesh);

// Everything that an answer depends on.
struct AnswerQuestionKey {
  int mesh = 0;
  std::string recipe;  // RecipeKey
  v1::DeformationModel model = v1::DEFORMATION_MODEL_GRADIENT_FIELD;
  int pose = 0;

  auto operator<=>(const AnswerQuestionKey&) const = default;
};
// Equal for sessions of one mesh that answer alike, their own model apart.
std::string RecipeKey(const SessionRequest& recipe);

// What was answered so far.
class ModelAnswers {
 public:
  // Internal unless the answer is that of a deformer in this process, as far as float32 goes, and
  // to the last bit the same every time.
  absl::Status Check(const AnswerQuestionKey& key, const Positions& answer);
  // Null: no call has asked.
  const Positions* Find(const AnswerQuestionKey& key) const;

 private:
  std::map<AnswerQuestionKey, Positions> answers_;
};

}  // namespace tissueform::testing
