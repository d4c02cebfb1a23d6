// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_session_calls.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <utility>

#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "tests/integration/model_choices.h"

namespace tissueform::testing {
namespace {

template <typename Map>
std::vector<std::string> NamesOf(const Map& map) {
  std::vector<std::string> names;
  names.reserve(map.size());
  for (const auto& [name, entry] : map) names.push_back(name);
  return names;
}

absl::Status TakeSession(ModelState& state, const v1::Session& reported,
                         const SessionRequest& request) {
  const std::string name =
      request.session_id.empty() ? reported.name() : SessionName(request.session_id);
  ServedSession session;
  session.mesh = request.mesh == NameOfMesh(1) ? 1 : 0;
  session.recipe = request;
  session.request_id = request.request_id;
  session.fingerprint = RequestFingerprint(ToProto(request));
  session.etag = reported.etag();
  session.create_time = reported.create_time().seconds();
  session.ready = true;
  if (!state.etags.insert(session.etag).second) return Wrong("etag ", session.etag, " comes again");
  if (!state.model.sessions.emplace(name, session).second) return Wrong(name, " comes again");
  return CheckSession(name, session, reported);
}

}  // namespace

absl::Status UploadMesh(ModelState& state, const Numbers& numbers) {
  const int mesh = static_cast<int>(numbers[0] % kModelMeshes);
  state.Log("UploadMesh(", mesh, ")");
  const BarProblem& problem = MeshOfModel(mesh);
  const std::vector<CellArray> arrays = problem.CellArrays();
  const MeshPayloadView payload =
      ViewMeshPayload(problem.mesh.positions(), problem.mesh.tets(), arrays);
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = state.meshes->UploadMesh(&context, &response);
  v1::UploadMeshRequest request;
  *request.mutable_header() = ToProto(payload.shape, payload.Sha256());
  // Where a write fails the server has ended the call.
  if (writer->Write(request)) {
    request.mutable_chunk()->set_data(absl::StrJoin(payload.segments, ""));
    request.mutable_chunk()->set_finish_write(true);
    if (writer->Write(request)) writer->WritesDone();
  }
  TF_RETURN_IF_ERROR(CheckOutcome(kFine, FromGrpcStatus(writer->Finish())));
  const bool known = !state.model.meshes.insert(NameOfMesh(mesh)).second;
  if (response.already_existed() != known || response.mesh().name() != NameOfMesh(mesh)) {
    return Wrong("must ", known ? "" : "not ", "be known, but ", response.DebugString());
  }
  return absl::OkStatus();
}

absl::Status GetMesh(ModelState& state, const Numbers& numbers) {
  v1::GetMeshRequest request;
  request.set_name(SomeMesh(numbers[0]));
  state.Log("GetMesh(", request.name(), ")");
  grpc::ClientContext context;
  v1::Mesh reported;
  const grpc::Status status = state.meshes->GetMesh(&context, request, &reported);
  TF_RETURN_IF_ERROR(CheckOutcome(state.model.OfMesh(request.name()), FromGrpcStatus(status)));
  if (status.ok() && reported.vertex_count() != MeshOfModel(0).mesh.num_vertices()) {
    return Wrong(reported.DebugString());
  }
  return absl::OkStatus();
}

absl::Status ListMeshes(ModelState& state, const Numbers& numbers) {
  v1::ListMeshesRequest request;
  request.set_page_size(SomePageSize(numbers[0]));
  state.Log("ListMeshes(", request.page_size(), ")");
  const auto names = ReadPages<v1::ListMeshesRequest, v1::ListMeshesResponse>(
      request,
      [&state](grpc::ClientContext* context, const v1::ListMeshesRequest& page_request,
               v1::ListMeshesResponse* page) {
        return state.meshes->ListMeshes(context, page_request, page);
      },
      [](const v1::ListMeshesResponse& page) {
        std::vector<std::string> of_page;
        for (const v1::Mesh& mesh : page.meshes()) of_page.push_back(mesh.name());
        return of_page;
      });
  return CheckPages(request.page_size(), names,
                    {state.model.meshes.begin(), state.model.meshes.end()});
}

absl::Status DeleteMesh(ModelState& state, const Numbers& numbers) {
  const std::string mesh = SomeMesh(numbers[0]);
  state.Log("DeleteMesh(", mesh, ")");
  const Outcome expected = state.model.OfDeleteMesh(mesh);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, state.client->DeleteMesh(mesh)));
  if (expected.ok()) state.model.meshes.erase(mesh);
  return absl::OkStatus();
}

absl::Status CreateSession(ModelState& state, const Numbers& numbers) {
  const std::string mesh = SomeMesh(numbers[0]);
  const int recipe = static_cast<int>(numbers[1] % 12 < kRecipes ? numbers[1] % 12 : 0);
  SessionRequest request = RecipeOf(mesh == NameOfMesh(1) ? 1 : 0, recipe);
  request.mesh = mesh;
  if (numbers[2] % 8 < 4) request.session_id = ChosenId(numbers[2] % 8);
  if (numbers[2] % 32 == 7) request.session_id = "too-short";
  if (numbers[3] % 8 < 3) request.request_id = absl::StrCat("request-", numbers[3] % 8);
  if (numbers[3] % 32 == 7) request.request_id = std::string(65, 'x');
  state.Log("CreateSession(", mesh, ", recipe ", recipe, ", session_id \"", request.session_id,
            "\", request_id \"", request.request_id, "\")");
  std::string joined;
  const Outcome expected = state.model.OfCreateSession(request, recipe, kMaxSessions, &joined);
  const absl::StatusOr<v1::Session> reported = state.client->CreateSession(request);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  if (!reported.ok()) return absl::OkStatus();
  if (joined.empty()) return TakeSession(state, *reported, request);
  ServedSession& session = state.model.sessions.at(joined);
  session.ready = true;
  return CheckSession(joined, session, *reported);
}

absl::Status GetSession(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomeSession(numbers[0]);
  state.Log("GetSession(", name, ")");
  const absl::StatusOr<v1::Session> reported = state.client->GetSession(name);
  TF_RETURN_IF_ERROR(CheckOutcome(state.model.OfSession(name), reported.status()));
  return reported.ok() ? CheckSession(name, state.model.sessions.at(name), *reported)
                       : absl::OkStatus();
}

absl::Status ListSessions(ModelState& state, const Numbers& numbers) {
  v1::ListSessionsRequest request;
  request.set_page_size(SomePageSize(numbers[0]));
  state.Log("ListSessions(", request.page_size(), ")");
  const auto names = ReadPages<v1::ListSessionsRequest, v1::ListSessionsResponse>(
      request,
      [&state](grpc::ClientContext* context, const v1::ListSessionsRequest& page_request,
               v1::ListSessionsResponse* page) {
        return state.sessions->ListSessions(context, page_request, page);
      },
      [](const v1::ListSessionsResponse& page) {
        std::vector<std::string> of_page;
        for (const v1::Session& session : page.sessions()) of_page.push_back(session.name());
        return of_page;
      });
  return CheckPages(request.page_size(), names, NamesOf(state.model.sessions));
}

absl::Status UpdateSession(ModelState& state, const Numbers& numbers) {
  ModelUpdate update = SomeUpdate(numbers[2]);
  const std::string name = state.SomeSession(numbers[0]);
  update.request.set_name(name);
  ServedSession* session = state.model.Find(name);
  if (session != nullptr && numbers[1] % 4 < 2) update.request.set_etag(session->etag);
  if (numbers[1] % 4 == 3 && !state.etags.empty()) {
    update.request.set_etag(*std::next(state.etags.begin(), numbers[1] / 4 % state.etags.size()));
  }
  state.Log("UpdateSession(", name, ", etag \"", update.request.etag(), "\", ", update.words, ")");
  const Outcome expected =
      state.model.OfUpdateSession(update.request, update.changes, update.legal);
  const absl::StatusOr<v1::Session> reported = state.client->UpdateSession(update.request);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  if (!reported.ok()) return absl::OkStatus();
  Apply(update.request, session);
  session->etag = reported->etag();
  if (!state.etags.insert(reported->etag()).second)
    return Wrong("etag ", reported->etag(), " comes again");
  return CheckSession(name, *session, *reported);
}

absl::Status DeleteSession(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomeSession(numbers[0]);
  state.Log("DeleteSession(", name, ")");
  TF_RETURN_IF_ERROR(CheckOutcome(state.model.OfSession(name), state.client->DeleteSession(name)));
  state.model.sessions.erase(name);
  return absl::OkStatus();
}

}  // namespace tissueform::testing
