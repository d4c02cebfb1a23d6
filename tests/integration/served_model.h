// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"
#include "tests/integration/model_answers.h"
#include "tissueform/v1/case.pb.h"
#include "tissueform/v1/prediction.pb.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// What a server must say of meshes, sessions and predictions, from plain maps of what it has
// acknowledged. One caller, one call at a time; nothing of it is taken from the server's code but
// the conversions of messages.
namespace tissueform::testing {

// How a call ends.
struct Outcome {
  absl::StatusCode code = absl::StatusCode::kOk;
  ErrorReason reason = ErrorReason::kInternalError;  // of errors

  bool ok() const { return code == absl::StatusCode::kOk; }
};
inline constexpr Outcome kFine{};
inline constexpr Outcome kInvalidRequest{absl::StatusCode::kInvalidArgument,
                                         ErrorReason::kInvalidRequest};
// OK when `got` is as expected, else Internal with both.
absl::Status CheckOutcome(const Outcome& expected, const absl::Status& got);

// What sessions are made from, by number.
inline constexpr int kRecipes = 7;
SessionRequest RecipeOf(int mesh, int number);
// What makes a recipe none, and when: before the server looks who has its ids, or after it.
enum class RecipeFault { kNone, kSeenFirst, kSeenLast };
RecipeFault FaultOf(int recipe);

struct ServedSession {
  int mesh = 0;
  SessionRequest recipe;
  std::string request_id;
  std::string fingerprint;
  std::string etag;         // empty: not seen yet
  int64_t create_time = 0;  // 0: not seen yet
  std::optional<int> pose;  // committed: SomePose(*pose)
  bool ready = false;       // in memory

  const std::string& handle() const { return recipe.handles.front().name; }
};

struct ServedPrediction {
  AnswerQuestionKey key;
  std::string session;
  std::string request_id;
  std::string fingerprint;
  v1::Prediction reported;  // when it was made
};

struct ServedModel {
  std::set<std::string> meshes;                          // names
  std::map<std::string, ServedSession> sessions;         // by name
  std::map<std::string, ServedPrediction> predictions;   // by name
  std::map<std::string, v1::Case> cases;                 // by name, as reported when sent
  std::map<std::string, std::string> names_of_requests;  // of predictions, deleted ones too

  int CountMadeFrom(const std::string& mesh) const;
  ServedSession* Find(const std::string& session);
  // Null if it does not exist.
  const std::string* FindRequest(const std::string& request_id) const;
  const ServedPrediction* FindPredictionOfRequest(const std::string& request_id) const;

  Outcome OfMesh(const std::string& mesh) const;
  Outcome OfDeleteMesh(const std::string& mesh) const;
  Outcome OfSession(const std::string& session) const;
  // `joined` is set to the session that the call of before has made.
  Outcome OfCreateSession(const SessionRequest& request, int recipe, int max_sessions,
                          std::string* joined) const;
  Outcome OfUpdateSession(const v1::UpdateSessionRequest& request, bool changes, bool legal) const;
  Outcome OfPrediction(const std::string& prediction) const;
  // `joined` is set to the prediction that the call of before has made.
  Outcome OfCreatePrediction(const std::string& session, const std::string& request_id,
                             const std::string& fingerprint, bool legal, std::string* joined) const;
  Outcome OfCompare(const std::string& one, const std::string& other) const;
  // With a model.
  Outcome OfCompareModel(const std::string& one) const;

  void Restarted();  // nothing is in memory
};

// What the server must say of a session, without what it measures (times of use and of stages,
// bytes, weights).
v1::Session ExpectedSession(const std::string& name, const ServedSession& session);
void ClearMeasured(v1::Session* session);

}  // namespace tissueform::testing
