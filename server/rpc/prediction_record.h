// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

#include "server/access/auth/identity.h"
#include "server/rpc/single_answer.h"
#include "server/session/session.h"
#include "server/store/prediction_store.h"
#include "tissueform/v1/prediction.pb.h"
#include "tissueform/v1/prediction_service.pb.h"

namespace tissueform {

// A prediction as it is stored, and as it is sent to clients.

// What makes the creation idempotent.
struct PredictionRequestKey {
  std::string id;           // of the prediction
  std::string fingerprint;  // empty: the request had no id
};

// The id follows from owner and `request_id`; a random one where that is empty.
PredictionRequestKey KeyOf(const Principal& owner, const std::string& request_id,
                           const std::string& fingerprint);

// What a planner says of a prediction beside what it asks.
struct PredictionNotes {
  std::string case_sha256;  // empty: of no case
  std::string title;
};
// Errors: InvalidArgument.
absl::StatusOr<PredictionNotes> NotesOf(const v1::CreatePredictionRequest& request,
                                        int max_title_bytes);

// The answer as it goes to the store.
struct PredictionToKeep {
  PredictionRecord record;
  std::string positions;  // float32, all vertices
};
PredictionToKeep ToKeep(const PredictionRequestKey& key, const Principal& owner, int64_t now_s,
                        const PredictionNotes& notes, const SingleAnswer& answer);

struct KeptPrediction {
  v1::Prediction prediction;
  std::string fingerprint;  // PredictionRequestKey::fingerprint
};
// Errors: DataLoss.
absl::StatusOr<KeptPrediction> FromRecord(const PredictionRecord& record);

// Prediction.recipe_sha256 of what a session answers now.
std::string RecipeSha256(const Session& session);

}  // namespace tissueform
