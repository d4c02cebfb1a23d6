// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/access_calls.h"

#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform::testing {
namespace {

using Kind = AccessWorld::Kind;

template <typename Response>
Answer AnswerOf(const grpc::Status& status, const Response& response) {
  return {status, response.SerializeAsString()};
}

// All messages of a stream of answers.
template <typename Response>
Answer ReadAll(std::unique_ptr<grpc::ClientReader<Response>> reader) {
  Answer answer;
  Response message;
  while (reader->Read(&message)) answer.messages += message.SerializeAsString();
  answer.status = reader->Finish();
  return answer;
}

template <typename Request>
Request Naming(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

void AddRest(google::protobuf::RepeatedPtrField<v1::HandlePose>* poses) {
  poses->Add()->set_handle("top");
}

Answer Drag(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  const auto stream = stubs.deform->Deform(context);
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(name);
  stream->Write(request);
  stream->WritesDone();
  Answer answer;
  v1::DeformResponse message;
  while (stream->Read(&message)) answer.messages += message.SerializeAsString();
  answer.status = stream->Finish();
  return answer;
}

Answer ReadAnswersOf(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::GetPreparedAnswersRequest request;
  request.set_session(name);
  request.mutable_vertices()->mutable_list()->add_vertices(0);
  request.mutable_prepared()->set_tolerance_mm(0.1);
  return ReadAll(stubs.deform->GetPreparedAnswers(context, request));
}

// Until the first message.
Answer WatchOnce(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::WatchRequest request;
  request.set_session(name);
  const auto stream = stubs.deform->Watch(context, request);
  v1::WatchResponse message;
  if (!stream->Read(&message)) return {stream->Finish(), ""};
  context->TryCancel();
  while (stream->Read(&message)) {
  }
  stream->Finish();
  return {grpc::Status::OK, "started"};
}

Answer DeformOne(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::DeformOnceRequest request;
  request.set_session(name);
  AddRest(request.mutable_poses());
  v1::DeformOnceResponse response;
  return AnswerOf(stubs.deform->DeformOnce(context, request, &response), response);
}

Answer FitNothing(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::FitRequest request;
  request.set_session(name);
  v1::FitTarget* target = request.add_targets();
  target->set_name("point");
  target->mutable_vertices()->add_vertices(0);
  target->mutable_position_mm()->set_x(1);
  v1::FitFreedom* freedom = request.add_freedoms();
  freedom->set_handle("top");
  freedom->mutable_translation_mm()->mutable_x()->set_lowest(-1);
  freedom->mutable_translation_mm()->mutable_x()->set_highest(1);
  v1::FitResponse response;
  return AnswerOf(stubs.plans->Fit(context, request, &response), response);
}

// Of a version that never was: changes nothing.
Answer UpdateStale(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  auto request = Naming<v1::UpdateSessionRequest>(name);
  request.set_etag("none");
  request.set_poisson_ratio(0.3);
  v1::Session response;
  return AnswerOf(stubs.sessions->UpdateSession(context, request, &response), response);
}

Answer Prepare(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::PrepareSessionRequest request;
  request.set_open(name);
  return ReadAll(stubs.sessions->PrepareSession(context, request));
}

Answer Compare(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::ComparePredictionsRequest request;
  request.set_prediction(name);
  request.set_other_prediction(name);
  return ReadAll(stubs.predictions->ComparePredictions(context, request));
}

Answer Shares(const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {
  v1::ListSharesRequest request;
  request.set_resource(name);
  v1::ListSharesResponse response;
  return AnswerOf(stubs.access->ListShares(context, request, &response), response);
}

// gRPC's generated methods, all of one form.
#define TF_UNARY(service, method, Request, Response)                                             \
  [](const Stubs& stubs, grpc::ClientContext* context, const std::string& name) {                \
    Response response;                                                                           \
    return AnswerOf(stubs.service->method(context, Naming<Request>(name), &response), response); \
  }
#define TF_READ(service, method, Request)                                         \
  [](const Stubs& stubs, grpc::ClientContext* context, const std::string& name) { \
    return ReadAll(stubs.service->method(context, Naming<Request>(name)));        \
  }

}  // namespace

absl::StatusOr<Authenticated> NamedCallers::Authenticate(const Credentials& credentials) {
  absl::string_view name;
  if (credentials.authorization.size() == 1) name = credentials.authorization.front();
  if (!absl::ConsumePrefix(&name, "Bearer ") || name.empty()) {
    return absl::UnauthenticatedError("no token; log in");
  }
  Principal principal{.name = std::string(name), .projects = {"p"}};
  if (absl::ascii_isupper(static_cast<unsigned char>(name[0]))) principal.roles = {"publisher"};
  if (name == "ADMIN") principal.roles.insert("admin");
  if (name == "BRIDGE") principal.roles.insert("bridge");
  return Authenticated{.principal = std::make_shared<const Principal>(std::move(principal))};
}

absl::Status NamedCallers::IsStillAuthorized(const Authenticated& /*authenticated*/) {
  return absl::OkStatus();
}

std::unique_ptr<grpc::ClientContext> ContextOf(const AccessWorld::Caller& caller) {
  auto context = std::make_unique<grpc::ClientContext>();
  context->AddMetadata("authorization",
                       "Bearer " + (caller.link.empty() ? caller.name : caller.link));
  context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  return context;
}

Stubs::Stubs(const std::shared_ptr<grpc::Channel>& channel)
    : access(v1::AccessService::NewStub(channel)),
      cases(v1::CaseService::NewStub(channel)),
      deform(v1::DeformService::NewStub(channel)),
      exports(v1::ExportService::NewStub(channel)),
      meshes(v1::MeshService::NewStub(channel)),
      plans(v1::PlanService::NewStub(channel)),
      predictions(v1::PredictionService::NewStub(channel)),
      info(v1::ServerInfoService::NewStub(channel)),
      sessions(v1::SessionService::NewStub(channel)) {}

const std::vector<NamedCall>& NamedCalls() {
  static const auto* calls = new std::vector<NamedCall>{
      {"GetSession", Kind::kSession, AccessWorld::kLook, true,
       TF_UNARY(sessions, GetSession, v1::GetSessionRequest, v1::Session)},
      {"UpdateSession", Kind::kSession, AccessWorld::kOwn, false, UpdateStale},
      {"PrepareSession", Kind::kSession, AccessWorld::kDrag, false, Prepare},
      {"DeformOnce", Kind::kSession, AccessWorld::kDrag, false, DeformOne},
      {"Deform", Kind::kSession, AccessWorld::kDrag, false, Drag},
      {"GetPreparedAnswers", Kind::kSession, AccessWorld::kDrag, false, ReadAnswersOf},
      {"Watch", Kind::kSession, AccessWorld::kLook, true, WatchOnce},
      {"Fit", Kind::kSession, AccessWorld::kDrag, false, FitNothing},
      {"ListShares of a session", Kind::kSession, AccessWorld::kOwn, false, Shares},
      {"GetPrediction", Kind::kPrediction, AccessWorld::kLook, false,
       TF_UNARY(predictions, GetPrediction, v1::GetPredictionRequest, v1::Prediction)},
      {"ReadPositions", Kind::kPrediction, AccessWorld::kLook, false,
       TF_READ(predictions, ReadPositions, v1::ReadPositionsRequest)},
      {"ComparePredictions", Kind::kPrediction, AccessWorld::kLook, false, Compare},
      {"ListShares of a prediction", Kind::kPrediction, AccessWorld::kOwn, false, Shares},
      {"GetCase", Kind::kCase, AccessWorld::kLook, true,
       TF_UNARY(cases, GetCase, v1::GetCaseRequest, v1::Case)},
      {"ReadCase", Kind::kCase, AccessWorld::kLook, true,
       TF_READ(cases, ReadCase, v1::ReadCaseRequest)},
      {"ListShares of a case", Kind::kCase, AccessWorld::kOwn, false, Shares},
      {"GetExport", Kind::kExport, AccessWorld::kLook, false,
       TF_UNARY(exports, GetExport, v1::GetExportRequest, v1::Export)},
      {"GetMesh", Kind::kMesh, AccessWorld::kLook, true,
       TF_UNARY(meshes, GetMesh, v1::GetMeshRequest, v1::Mesh)},
      {"GetSurface", Kind::kMesh, AccessWorld::kLook, true,
       TF_READ(meshes, GetSurface, v1::GetSurfaceRequest)},
  };
  return *calls;
}

SentMesh::SentMesh(uint32_t seed) : problem(seed, {2, 2, 3}) {
  const std::vector<CellArray> arrays = problem.CellArrays();
  name = MeshName(ViewMeshPayload(problem.mesh.positions(), problem.mesh.tets(), arrays).Sha256());
}

Answer SendMesh(const Stubs& stubs, const AccessWorld::Caller& caller, const SentMesh& mesh,
                v1::UploadMeshResponse* response) {
  const std::vector<CellArray> arrays = mesh.problem.CellArrays();
  const MeshPayloadView view =
      ViewMeshPayload(mesh.problem.mesh.positions(), mesh.problem.mesh.tets(), arrays);
  const auto context = ContextOf(caller);
  const auto stream = stubs.meshes->UploadMesh(context.get(), response);
  v1::UploadMeshRequest request;
  v1::MeshHeader* header = request.mutable_header();
  header->set_vertex_count(view.shape.num_vertices);
  header->set_tet_count(view.shape.num_tets);
  for (const std::string& array : view.shape.cell_arrays) header->add_cell_arrays(array);
  header->set_total_bytes(view.shape.TotalBytes());
  header->set_sha256(*ParseMeshName(mesh.name));
  stream->Write(request);
  for (const absl::string_view segment : view.segments) {
    request.mutable_chunk()->mutable_data()->append(segment.data(), segment.size());
  }
  request.mutable_chunk()->set_finish_write(true);
  stream->Write(request);
  stream->WritesDone();
  const grpc::Status status = stream->Finish();
  return AnswerOf(status, *response);
}

Answer SendCase(const Stubs& stubs, const AccessWorld::Caller& caller, const std::string& bytes,
                const std::string& project, v1::UploadCaseResponse* response) {
  const auto context = ContextOf(caller);
  const auto stream = stubs.cases->UploadCase(context.get(), response);
  v1::UploadCaseRequest request;
  request.mutable_header()->set_sha256(Sha256Hex({bytes}));
  request.mutable_header()->set_total_bytes(static_cast<int64_t>(bytes.size()));
  request.mutable_header()->set_title(absl::StrCat("of ", caller.name));
  request.mutable_header()->set_project(project);
  stream->Write(request);
  request.mutable_chunk()->set_data(bytes);
  request.mutable_chunk()->set_finish_write(true);
  stream->Write(request);
  stream->WritesDone();
  const grpc::Status status = stream->Finish();
  return AnswerOf(status, *response);
}

namespace {

template <typename Request, typename Response, typename Call, typename Items>
Answer ListPages(const AccessWorld::Caller& caller, Call call, Items items,
                 std::vector<std::string>* names) {
  Answer answer;
  Request request;
  request.set_page_size(3);
  do {
    Response response;
    const auto context = ContextOf(caller);
    answer.status = call(context.get(), request, &response);
    if (!answer.status.ok()) return answer;
    answer.messages += response.SerializeAsString();
    for (const auto& item : items(response)) names->push_back(item.name());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return answer;
}

}  // namespace

Answer ListNames(const Stubs& stubs, const AccessWorld::Caller& caller, AccessWorld::Kind kind,
                 std::vector<std::string>* names) {
  using grpc::ClientContext;
  switch (kind) {
    case Kind::kSession:
      return ListPages<v1::ListSessionsRequest, v1::ListSessionsResponse>(
          caller,
          [&](ClientContext* context, const auto& request, auto* response) {
            return stubs.sessions->ListSessions(context, request, response);
          },
          [](const auto& response) { return response.sessions(); }, names);
    case Kind::kPrediction:
      return ListPages<v1::ListPredictionsRequest, v1::ListPredictionsResponse>(
          caller,
          [&](ClientContext* context, const auto& request, auto* response) {
            return stubs.predictions->ListPredictions(context, request, response);
          },
          [](const auto& response) { return response.predictions(); }, names);
    case Kind::kCase:
      return ListPages<v1::ListCasesRequest, v1::ListCasesResponse>(
          caller,
          [&](ClientContext* context, const auto& request, auto* response) {
            return stubs.cases->ListCases(context, request, response);
          },
          [](const auto& response) { return response.cases(); }, names);
    case Kind::kExport:
      return ListPages<v1::ListExportsRequest, v1::ListExportsResponse>(
          caller,
          [&](ClientContext* context, const auto& request, auto* response) {
            return stubs.exports->ListExports(context, request, response);
          },
          [](const auto& response) { return response.exports(); }, names);
    case Kind::kMesh:
      break;
  }
  return ListPages<v1::ListMeshesRequest, v1::ListMeshesResponse>(
      caller,
      [&](ClientContext* context, const auto& request, auto* response) {
        return stubs.meshes->ListMeshes(context, request, response);
      },
      [](const auto& response) { return response.meshes(); }, names);
}

}  // namespace tissueform::testing
