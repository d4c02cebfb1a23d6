// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/served_model.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"

namespace tissueform::testing {
namespace {

constexpr Outcome kNoMesh{absl::StatusCode::kNotFound, ErrorReason::kMeshNotFound};
constexpr Outcome kNoSession{absl::StatusCode::kNotFound, ErrorReason::kSessionNotFound};
constexpr Outcome kNoPrediction{absl::StatusCode::kNotFound, ErrorReason::kPredictionNotFound};
constexpr Outcome kNotComparable{absl::StatusCode::kFailedPrecondition,
                                 ErrorReason::kNotComparable};
constexpr Outcome kReused{absl::StatusCode::kInvalidArgument, ErrorReason::kRequestIdReused};

constexpr size_t kMaxRequestIdBytes = 64;
constexpr size_t kMinSessionIdBytes = 16;

// The letters of a name that one of ours cannot have.
bool IsNoName(const std::string& name) { return absl::StrContains(name, ' '); }

}  // namespace

absl::Status CheckOutcome(const Outcome& expected, const absl::Status& got) {
  const bool same =
      got.code() == expected.code && (expected.ok() || HasReason(got, expected.reason));
  if (same) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(
      "must end with ", absl::StatusCodeToString(expected.code),
      expected.ok() ? "" : absl::StrCat(" ", ReasonName(expected.reason)), ", but ended with ",
      absl::StatusCodeToString(got.code()), " ", ReasonOf(got), ": ", got.message()));
}

SessionRequest RecipeOf(int mesh, int number) {
  SessionRequest recipe = MeshOfModel(mesh).Request(NameOfMesh(mesh));
  switch (number) {
    case 1:
      recipe.stiffness = 2000.0;
      break;
    case 2:
      recipe.stiffness = 3000.0;
      recipe.model = DeformationModel::kLinearElastic;
      recipe.poisson_ratio = 0.3;
      break;
    case 3:
      recipe.handles.front().name = "cap";
      break;
    case 4:
      recipe.stiffness = "no_such_array";
      break;
    case 5:
      recipe.fixed.push_back(recipe.handles.front().vertices.front());
      break;
    case 6:
      recipe.handles.front().name = std::string(129, 'x');
      break;
    default:
      break;
  }
  return recipe;
}

RecipeFault FaultOf(int recipe) {
  if (recipe < 4) return RecipeFault::kNone;
  return recipe < 6 ? RecipeFault::kSeenLast : RecipeFault::kSeenFirst;
}

int ServedModel::CountMadeFrom(const std::string& mesh) const {
  return static_cast<int>(std::count_if(sessions.begin(), sessions.end(), [&](const auto& entry) {
    return NameOfMesh(entry.second.mesh) == mesh;
  }));
}

ServedSession* ServedModel::Find(const std::string& session) {
  const auto found = sessions.find(session);
  return found == sessions.end() ? nullptr : &found->second;
}

const std::string* ServedModel::FindRequest(const std::string& request_id) const {
  if (request_id.empty()) return nullptr;
  const auto found = std::find_if(sessions.begin(), sessions.end(), [&](const auto& entry) {
    return entry.second.request_id == request_id;
  });
  return found == sessions.end() ? nullptr : &found->first;
}

const ServedPrediction* ServedModel::FindPredictionOfRequest(const std::string& request_id) const {
  if (request_id.empty()) return nullptr;
  const auto found = std::find_if(predictions.begin(), predictions.end(), [&](const auto& entry) {
    return entry.second.request_id == request_id;
  });
  return found == predictions.end() ? nullptr : &found->second;
}

Outcome ServedModel::OfMesh(const std::string& mesh) const {
  if (IsNoName(mesh)) return kInvalidRequest;
  return meshes.contains(mesh) ? kFine : kNoMesh;
}

Outcome ServedModel::OfDeleteMesh(const std::string& mesh) const {
  if (IsNoName(mesh)) return kInvalidRequest;
  if (CountMadeFrom(mesh) > 0) {
    return {absl::StatusCode::kFailedPrecondition, ErrorReason::kMeshInUse};
  }
  return OfMesh(mesh);
}

Outcome ServedModel::OfSession(const std::string& session) const {
  if (IsNoName(session)) return kInvalidRequest;
  return sessions.contains(session) ? kFine : kNoSession;
}

Outcome ServedModel::OfCreateSession(const SessionRequest& request, int recipe, int max_sessions,
                                     std::string* joined) const {
  if (const Outcome mesh = OfMesh(request.mesh); !mesh.ok()) return mesh;
  const std::string& id = request.session_id;
  const bool bad_id = !id.empty() && id.size() < kMinSessionIdBytes;
  if (request.request_id.size() > kMaxRequestIdBytes || bad_id ||
      FaultOf(recipe) == RecipeFault::kSeenFirst) {
    return kInvalidRequest;
  }
  if (const std::string* earlier = FindRequest(request.request_id); earlier != nullptr) {
    if (sessions.at(*earlier).fingerprint != RequestFingerprint(ToProto(request))) return kReused;
    *joined = *earlier;
    return kFine;
  }
  if (sessions.contains(SessionName(id))) {
    return {absl::StatusCode::kAlreadyExists, ErrorReason::kSessionIdTaken};
  }
  if (sessions.size() >= static_cast<size_t>(max_sessions)) {
    return {absl::StatusCode::kResourceExhausted, ErrorReason::kTooManySessions};
  }
  return FaultOf(recipe) == RecipeFault::kNone ? kFine : kInvalidRequest;
}

Outcome ServedModel::OfUpdateSession(const v1::UpdateSessionRequest& request, bool changes,
                                     bool legal) const {
  if (IsNoName(request.name()) || !changes) return kInvalidRequest;
  if (const Outcome known = OfSession(request.name()); !known.ok()) return known;
  if (!request.etag().empty() && request.etag() != sessions.at(request.name()).etag) {
    return {absl::StatusCode::kAborted, ErrorReason::kStaleEtag};
  }
  return legal ? kFine : kInvalidRequest;
}

Outcome ServedModel::OfPrediction(const std::string& prediction) const {
  if (IsNoName(prediction)) return kInvalidRequest;
  return predictions.contains(prediction) ? kFine : kNoPrediction;
}

Outcome ServedModel::OfCreatePrediction(const std::string& session, const std::string& request_id,
                                        const std::string& fingerprint, bool legal,
                                        std::string* joined) const {
  if (request_id.size() > kMaxRequestIdBytes || IsNoName(session)) return kInvalidRequest;
  if (const ServedPrediction* earlier = FindPredictionOfRequest(request_id); earlier != nullptr) {
    if (earlier->fingerprint != fingerprint) return kReused;
    *joined = earlier->reported.name();
    return kFine;
  }
  if (const Outcome known = OfSession(session); !known.ok()) return known;
  return legal ? kFine : kInvalidRequest;
}

Outcome ServedModel::OfCompare(const std::string& one, const std::string& other) const {
  for (const std::string& name : {one, other}) {
    if (const Outcome known = OfPrediction(name); !known.ok()) return known;
  }
  return predictions.at(one).key.mesh == predictions.at(other).key.mesh ? kFine : kNotComparable;
}

Outcome ServedModel::OfCompareModel(const std::string& one) const {
  if (const Outcome known = OfPrediction(one); !known.ok()) return known;
  const ServedPrediction& prediction = predictions.at(one);
  const auto session = sessions.find(prediction.session);
  if (session == sessions.end()) return kNoSession;
  const bool same = session->second.mesh == prediction.key.mesh &&
                    RecipeKey(session->second.recipe) == prediction.key.recipe;
  return same ? kFine : kNotComparable;
}

void ServedModel::Restarted() {
  for (auto& [name, session] : sessions) session.ready = false;
}

v1::Session ExpectedSession(const std::string& name, const ServedSession& session) {
  const SessionRequest& recipe = session.recipe;
  const BarProblem& problem = MeshOfModel(session.mesh);
  v1::Session expected;
  expected.set_name(name);
  expected.set_mesh(recipe.mesh);
  expected.set_model(ToProto(recipe.model));
  expected.set_poisson_ratio(recipe.poisson_ratio);
  *expected.mutable_gradient_field() = ToProto(recipe.gradient_field);
  expected.set_fixed_vertex_count(static_cast<int64_t>(recipe.fixed.size()));
  const auto moved = static_cast<int64_t>(recipe.handles.front().vertices.size());
  expected.add_handles(session.handle());
  expected.add_handle_vertex_counts(moved);
  if (session.pose.has_value()) {
    *expected.add_committed_poses() = ToProto(NamedPose{session.handle(), SomePose(*session.pose)});
  }
  expected.set_etag(session.etag);
  expected.mutable_create_time()->set_seconds(session.create_time);
  expected.set_state(session.ready ? v1::SESSION_STATE_READY : v1::SESSION_STATE_STORED);
  if (session.ready) {
    expected.set_vertex_count(problem.mesh.num_vertices());
    expected.set_tet_count(problem.mesh.num_tets());
    expected.set_free_vertex_count(problem.mesh.num_vertices() - moved -
                                   expected.fixed_vertex_count());
  }
  return expected;
}

void ClearMeasured(v1::Session* session) {
  session->clear_last_use_time();
  session->clear_bytes_held();
  session->clear_factor_bytes();
  session->clear_shared_bytes();
  session->clear_seconds();
  session->clear_negative_weight_count();
  session->clear_harmonic_min();
  session->clear_harmonic_max();
}

}  // namespace tissueform::testing
