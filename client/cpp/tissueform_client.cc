// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/tissueform_client.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "client/cpp/client_call.h"
#include "client/cpp/server_channel.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"

namespace tissueform {
namespace {

// All vertices of a mesh of a million are 12 MB; gRPC's own limit is 4 MiB.
constexpr int kMaxReceiveBytes = 256 << 20;
// A drag may rest for minutes. Routers forget connections on which nothing goes, and a server that
// lost its power says nothing: this finds out within a minute.
constexpr int kKeepaliveMilliseconds = 30'000;
constexpr int kReconnectMilliseconds = 100;
constexpr int kMaxReconnectMilliseconds = 2'000;

grpc::ChannelArguments ArgumentsOf(bool own_connection) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxReceiveBytes);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // Where the server is away gRPC asks again after 1 s, then ever more rarely, up to two minutes: a
  // drag is not to wait so long for a server that is back.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kReconnectMilliseconds);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kMaxReconnectMilliseconds);
  // After a failure it looks the name up again before it tries, and that 30 s apart.
  arguments.SetInt(GRPC_ARG_DNS_MIN_TIME_BETWEEN_RESOLUTIONS_MS, kReconnectMilliseconds);
  if (own_connection) arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return arguments;
}

// Empty where the server is to choose the id.
std::string SessionNameOf(const std::string& id) { return id.empty() ? "" : SessionName(id); }

}  // namespace

absl::StatusOr<std::unique_ptr<TissueformClient>> TissueformClient::Connect(
    const std::string& address, const Options& options) {
  if (address.find(':') == std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", address, "\" has no port; give the server as HOST:PORT"));
  }
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<TokenFile> token, OpenTokenOf(options.connection));
  TF_ASSIGN_OR_RETURN(
      const std::shared_ptr<grpc::Channel> channel,
      MakeServerChannel(address, options.connection, token, ArgumentsOf(options.own_connection)));
  if (!channel->WaitForConnected(std::chrono::system_clock::now() + options.connect_deadline)) {
    return absl::UnavailableError(absl::StrCat(
        "no tissueform-server answers at ", address, " within ",
        std::chrono::duration<double>(options.connect_deadline).count(),
        " s; start one (tissueform-server --port PORT) or check address and firewall: `tissueform "
        "doctor ",
        address, "` finds the cause"));
  }
  return std::unique_ptr<TissueformClient>(new TissueformClient(channel, token, options));
}

TissueformClient::TissueformClient(const std::shared_ptr<grpc::Channel>& channel,
                                   std::shared_ptr<TokenFile> token, const Options& options)
    : options_(options),
      token_(std::move(token)),
      meshes_(v1::MeshService::NewStub(channel)),
      sessions_(v1::SessionService::NewStub(channel)),
      deform_(v1::DeformService::NewStub(channel)),
      server_info_(v1::ServerInfoService::NewStub(channel)),
      predictions_(channel, options.call_deadline, &routes_),
      cases_(channel, options.call_deadline, &routes_),
      plan_builds_(channel, options.call_deadline, &routes_),
      exports_(channel, options.call_deadline, &routes_),
      access_(channel, options.call_deadline, &routes_) {}

absl::StatusOr<v1::ServerInfo> TissueformClient::GetServerInfo() {
  v1::ServerInfo info;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return server_info_->GetServerInfo(context, {}, &info);
  }));
  return info;
}

absl::StatusOr<v1::Mesh> TissueformClient::UploadMesh(const TetMesh& mesh,
                                                      const std::vector<CellArray>& cell_arrays,
                                                      const UploadOptions& options) {
  for (const CellArray& array : cell_arrays) {
    if (array.values.size() != mesh.num_tets()) {
      return absl::InvalidArgumentError(absl::StrCat("cell array \"", array.name, "\" has ",
                                                     array.values.size(), " values for ",
                                                     mesh.num_tets(), " tets"));
    }
  }
  return UploadMesh(ViewMeshPayload(mesh.positions(), mesh.tets(), cell_arrays), options);
}

absl::StatusOr<v1::Mesh> TissueformClient::UploadMesh(const MeshPayloadView& payload,
                                                      const UploadOptions& options) {
  const std::string sha256 = payload.Sha256();
  // The name is the content: asking costs one round trip, and the same head again costs no more.
  const absl::StatusOr<v1::Mesh> known = GetMesh(MeshName(sha256));
  if (!absl::IsNotFound(known.status())) return known;
  return SendMesh(meshes_.get(), payload, sha256, options_.call_deadline, options);
}

absl::StatusOr<v1::Mesh> TissueformClient::GetMesh(const std::string& name) {
  v1::GetMeshRequest request;
  request.set_name(name);
  v1::Mesh mesh;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return meshes_->GetMesh(context, request, &mesh);
  }));
  return mesh;
}

absl::StatusOr<v1::QueryUploadResponse> TissueformClient::QueryUpload(const std::string& name) {
  v1::QueryUploadRequest request;
  request.set_name(name);
  v1::QueryUploadResponse response;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return meshes_->QueryUpload(context, request, &response);
  }));
  return response;
}

absl::StatusOr<std::vector<v1::Mesh>> TissueformClient::ListMeshes() {
  std::vector<v1::Mesh> meshes;
  v1::ListMeshesRequest request;
  do {
    v1::ListMeshesResponse response;
    TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
      return meshes_->ListMeshes(context, request, &response);
    }));
    meshes.insert(meshes.end(), response.meshes().begin(), response.meshes().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return meshes;
}

absl::Status TissueformClient::DeleteMesh(const std::string& name) {
  v1::DeleteMeshRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(&routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return meshes_->DeleteMesh(context, request, &response);
  });
}

absl::StatusOr<v1::Session> TissueformClient::CreateSession(const SessionRequest& request) {
  v1::CreateSessionRequest proto = ToProto(request);
  return CreateSession(proto, PrepareToRepeat(routes_, &proto));
}

absl::StatusOr<v1::Session> TissueformClient::CreateSession(const v1::CreateSessionRequest& request,
                                                            CallRepeat repeat) {
  v1::Session session;
  TF_RETURN_IF_ERROR(
      Call(SessionNameOf(request.session_id()), repeat, [&](grpc::ClientContext* context) {
        grpc::Status status = sessions_->CreateSession(context, request, &session);
        if (status.ok()) routes_.Remember(session.name(), NodeOf(*context));
        return status;
      }));
  return session;
}

absl::StatusOr<v1::Session> TissueformClient::GetSession(const std::string& name) {
  v1::GetSessionRequest request;
  request.set_name(name);
  v1::Session session;
  TF_RETURN_IF_ERROR(Call(name, CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return sessions_->GetSession(context, request, &session);
  }));
  return session;
}

absl::StatusOr<std::vector<v1::Session>> TissueformClient::ListSessions() {
  std::vector<v1::Session> sessions;
  v1::ListSessionsRequest request;
  do {
    v1::ListSessionsResponse response;
    TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
      return sessions_->ListSessions(context, request, &response);
    }));
    sessions.insert(sessions.end(), response.sessions().begin(), response.sessions().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return sessions;
}

absl::StatusOr<v1::Session> TissueformClient::UpdateSession(
    const v1::UpdateSessionRequest& request) {
  v1::Session session;
  TF_RETURN_IF_ERROR(Call(request.name(), RepeatOf(request), [&](grpc::ClientContext* context) {
    return sessions_->UpdateSession(context, request, &session);
  }));
  return session;
}

absl::StatusOr<v1::Session> TissueformClient::PrepareSession(
    const v1::PrepareSessionRequest& request, const PreparationWait& wait) {
  v1::PrepareSessionRequest sent = request;
  std::string name = request.open();
  CallRepeat repeat = CallRepeat::kAlways;
  if (request.has_create()) {
    name = SessionNameOf(request.create().session_id());
    repeat = PrepareToRepeat(routes_, sent.mutable_create());
  }
  if (request.has_update()) {
    name = request.update().name();
    repeat = RepeatOf(request.update());
  }
  absl::StatusOr<v1::Session> session =
      WaitForSession(sessions_.get(), sent, {&routes_, name, repeat, Deadline()}, wait);
  // Version 0.1 does not report its stages.
  if (absl::IsUnimplemented(session.status()) && request.has_create()) {
    return CreateSession(sent.create(), repeat);
  }
  return session;
}

absl::Status TissueformClient::DeleteSession(const std::string& name) {
  v1::DeleteSessionRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(&routes_, name, Deadline(), [&](grpc::ClientContext* context) {
    return sessions_->DeleteSession(context, request, &response);
  });
}

absl::StatusOr<v1::DeformOnceResponse> TissueformClient::DeformOnce(
    const std::string& session, absl::Span<const NamedPose> poses, const AnswerVertices& vertices,
    v1::DeformationModel model, v1::PositionEncoding encoding) {
  v1::DeformOnceRequest request;
  request.set_model(model);
  request.set_encoding(encoding);
  request.set_session(session);
  for (const NamedPose& pose : poses) {
    *request.add_poses() = ToProto(pose);
  }
  *request.mutable_vertices() = ToProto(vertices);
  return DeformOnce(request);
}

absl::StatusOr<v1::DeformOnceResponse> TissueformClient::DeformOnce(
    const v1::DeformOnceRequest& request) {
  v1::DeformOnceResponse response;
  TF_RETURN_IF_ERROR(
      Call(request.session(), CallRepeat::kAlways, [&](grpc::ClientContext* context) {
        return deform_->DeformOnce(context, request, &response);
      }));
  return response;
}

absl::StatusOr<std::unique_ptr<DeformStream>> TissueformClient::OpenStream(
    const std::string& session, const DeformStream::Options& options,
    std::chrono::milliseconds patience) {
  return OpenWithAttempts(
      SessionAttempts(&routes_, session, CallRepeat::kAlways, patience),
      [&]() -> absl::StatusOr<std::unique_ptr<DeformStream>> {
        std::unique_ptr<DeformStream> stream(new DeformStream(&routes_, session));
        TF_RETURN_IF_ERROR(stream->Start(deform_.get(), options, token_));
        return stream;
      });
}

absl::StatusOr<std::unique_ptr<PreparedEvaluator>> TissueformClient::FetchPreparedAnswers(
    const v1::Session& session, const DeformStream::Options& options) {
  v1::DeformConfiguration configuration = DeformStream::ConfigurationOf(options);
  v1::GetPreparedAnswersRequest request;
  request.set_session(session.name());
  *request.mutable_vertices() = std::move(*configuration.mutable_vertices());
  request.set_model(configuration.model());
  if (configuration.has_prepared()) {
    *request.mutable_prepared() = std::move(*configuration.mutable_prepared());
  }
  return PreparedEvaluator::Fetch(deform_.get(), request,
                                  {session.handles().begin(), session.handles().end()}, &routes_,
                                  Deadline());
}

absl::StatusOr<std::unique_ptr<WatchStream>> TissueformClient::Watch(
    const std::string& session, const WatchStream::Options& options,
    std::chrono::milliseconds patience) {
  return OpenWithAttempts(SessionAttempts(&routes_, session, CallRepeat::kAlways, patience),
                          [&]() -> absl::StatusOr<std::unique_ptr<WatchStream>> {
                            std::unique_ptr<WatchStream> watch(
                                new WatchStream(deform_.get(), &routes_, session, options));
                            TF_RETURN_IF_ERROR(watch->Start());
                            return watch;
                          });
}

}  // namespace tissueform
