// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "client/cli/compare/comparison_report.h"
#include "client/cli/prediction/face_movement.h"
#include "client/cpp/tissueform_client.h"
#include "core/mechanics/deformation/comparison.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What the demo says of a prediction.
struct DemoPrediction {
  std::string move;    // what the bones do, in words
  std::string model;   // of the plan
  Positions deformed;  // #V by 3, LPS
  int64_t tets = 0;
  int64_t inverted_tets = 0;
  std::vector<RegionMovement> movement;  // of the named regions; none where the mesh has none
  // How far another model lies from the plan's: on the free skin, then on the face (all
  // named regions together) and in each region. Empty
  // where the other model could not answer, and why.
  std::string other_model;
  std::vector<RegionDistances> differences;
  absl::Status other_answer;

  // What the server keeps: the prediction, and the same by neo_hookean, with how far that lies from
  // it at all vertices. Empty where the plan's model is neo_hookean, or it could not answer, and
  // why.
  std::string kept;  // "predictions/{id}"
  std::string refined;
  DistanceSummary refinement;
  absl::Status refined_answer;
};

// Asks the server for the end pose by the plan's model, and by linear_elastic (gradient_field where
// the plan's is that) of the same session. Then has the server keep the first answer, and refine it
// by neo_hookean. `face` are the FaceRegions of the problem. Errors: those of DeformOnce with the
// plan's model, and of keeping its answer.
absl::StatusOr<DemoPrediction> PredictAtEnd(const PlanProblem& problem,
                                            const std::vector<ComparedRegion>& face,
                                            TissueformClient* client, const std::string& session);

// Keys of summary.json.
void AddToJson(const DemoPrediction& prediction, nlohmann::ordered_json* json);

// For people, on stdout: the tables.
void PrintPrediction(const DemoPrediction& prediction);
// What the server keeps of it.
void PrintKept(const DemoPrediction& prediction);

}  // namespace tissueform
