// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/doctor_calls.h"

#include <cmath>
#include <future>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "grpc/health/v1/health.pb.h"
#include "grpcpp/generic/generic_stub.h"

#include "client/cpp/client_call.h"
#include "client/cpp/mesh_upload.h"
#include "client/cpp/session_call.h"
#include "core/base/error_reason.h"
#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tissueform/v1/access_service.grpc.pb.h"
#include "tissueform/v1/deform_service.grpc.pb.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"
#include "tissueform/v1/server_info.grpc.pb.h"
#include "tissueform/v1/session_service.grpc.pb.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kCallDeadline{20};
// What servers grant when they look at a token's times.
constexpr double kLeewaySeconds = 60;
constexpr double kNoticedSeconds = 5;

std::chrono::system_clock::time_point Deadline() {
  return std::chrono::system_clock::now() + kCallDeadline;
}

void SetDeadline(grpc::ClientContext* context) { context->set_deadline(Deadline()); }

// By the server's name of what is wrong with a token (docs/security.md). A new login helps only
// against the first two.
std::string AdviceForToken(const std::string& failure) {
  if (failure == "no_token") return "log in (`tissueform login`) or give a token (--token-file)";
  if (failure == "expired") {
    return "log in again; if the line `token` reports a valid token, or the token is new, "
           "synchronize the "
           "clocks of server and provider with NTP instead";
  }
  if (failure == "not_yet_valid") {
    return "synchronize the clocks of server and provider with NTP; logging in again does not help";
  }
  if (failure == "issuer" || failure == "unknown_key" || failure == "signature") {
    return "compare the issuer in the line `token` with the server's --token-issuer: log in at "
           "that "
           "one (`tissueform login --issuer URL`), or correct the option "
           "(docs/operations.md, logins)";
  }
  if (failure == "audience") {
    return "log in for the server's audience (`tissueform login --audience NAME`), or correct the "
           "server's --token-audience; the same login again does not help";
  }
  return "the token is not usable; see docs/security.md for each reason";
}

std::string AdviceFor(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnauthenticated:
      return AdviceForToken(ErrorInfoOf(status).metadata["token"]);
    case absl::StatusCode::kPermissionDenied:
      return "ask the server's operator for this right";
    case absl::StatusCode::kResourceExhausted:
      return "the server or your quota is full: try again later, or delete what you need "
             "no "
             "more";
    case absl::StatusCode::kUnavailable:
      return "the server is shutting down, or the connection broke: try again in a minute";
    case absl::StatusCode::kDeadlineExceeded:
      return "timeout: is the server overloaded?";
    default:
      return "report this line to the server's operator";
  }
}

DoctorLine FailedCall(const std::string& check, const std::string& what,
                      const absl::Status& status) {
  return {
      .check = check,
      .finding = Finding::kFailed,
      .text = absl::StrCat(what, absl::StatusCodeToString(status.code()), ": ", status.message()),
      .advice = AdviceFor(status)};
}

// With a random offset of the last vertex, so that other users do not have the same mesh.
absl::StatusOr<TetMesh> TwoTets() {
  std::random_device random;
  const double shift = static_cast<double>(random() % 1'000'000) * 1e-6;
  Positions positions(5, 3);
  positions << 0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 10, 10, 10, 10 + shift;
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 1, 2, 3, 4;
  return TetMesh::Create(std::move(positions), std::move(tets));
}

SessionRequest RequestOf(const std::string& mesh) {
  SessionRequest request;
  request.mesh = mesh;
  request.stiffness = 1e4;
  request.fixed = {0};
  request.handles = {{.name = "far", .vertices = {4}}};
  return request;
}

// One pose, one frame.
absl::Status DragOnce(v1::DeformService::Stub* stub, SessionRoutes* routes,
                      const std::string& session) {
  v1::DeformRequest begin;
  begin.mutable_configuration()->set_session(session);
  v1::DeformRequest pose;
  pose.mutable_pose()->set_sequence(1);
  *pose.mutable_pose()->add_poses() =
      ToProto(NamedPose{.handle = "far", .pose = {.translation_mm = {0, 0, 1}}});
  bool answered = false;
  const absl::Status end = RunSessionCall(routes, session, CallRepeat::kAlways, Deadline(),
                                          [&](grpc::ClientContext* context) {
                                            const auto call = stub->Deform(context);
                                            if (call->Write(begin) && call->Write(pose)) {
                                              call->WritesDone();
                                              v1::DeformResponse response;
                                              while (call->Read(&response))
                                                answered = answered || response.has_frame();
                                            }
                                            return call->Finish();
                                          });
  return !end.ok() || answered ? end : absl::InternalError("the drag ended without a frame");
}

}  // namespace

DoctorLine DoctorCalls::CheckHealth() const {
  grpc::ClientContext context;
  SetDeadline(&context);
  const grpc::health::v1::HealthCheckRequest request;
  grpc::health::v1::HealthCheckResponse response;
  // Debian's files of the health service are made without its stub.
  grpc::TemplatedGenericStub<grpc::health::v1::HealthCheckRequest,
                             grpc::health::v1::HealthCheckResponse>
      stub(channel_);
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", {}, &request, &response,
                 [&done](grpc::Status end) { done.set_value(std::move(end)); });
  const absl::Status status = FromGrpcStatus(done.get_future().get());
  if (!status.ok()) {
    DoctorLine line = FailedCall("health", "", status);
    line.advice = "another program answers, not tissueform-server: is this its port, or a proxy's?";
    return line;
  }
  if (response.status() != grpc::health::v1::HealthCheckResponse::SERVING) {
    return {.check = "health",
            .finding = Finding::kFailed,
            .text = "the server reports NOT_SERVING: it is shutting down",
            .advice = "it accepts no new work: try again in a minute, or use another server"};
  }
  return {.check = "health", .text = "gRPC over HTTP/2, SERVING"};
}

bool DoctorCalls::CheckCaller(DoctorReport* report) const {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::Caller caller;
  const auto asked = std::chrono::system_clock::now();
  const absl::Status status =
      FromGrpcStatus(v1::AccessService::NewStub(channel_)->WhoAmI(&context, {}, &caller));
  if (absl::IsUnimplemented(status)) {
    report->Add({.check = "login",
                 .finding = Finding::kSkipped,
                 .text = "the server does not report the caller's identity"});
    return true;
  }
  if (!status.ok()) {
    report->Add(FailedCall("login", "", status));
    return !absl::IsUnauthenticated(status);
  }
  std::vector<std::string> roles(caller.roles().begin(), caller.roles().end());
  report->Add({.check = "login",
               .text = caller.principal().empty()
                           ? "the server does not require authentication"
                           : absl::StrCat("you are logged in as ", caller.principal(), ", roles: ",
                                          roles.empty() ? "none" : absl::StrJoin(roles, ", "))});
  if (!caller.has_server_time()) return true;
  const auto half = (std::chrono::system_clock::now() - asked) / 2;
  const double here = std::chrono::duration<double>((asked + half).time_since_epoch()).count();
  const double skew = static_cast<double>(caller.server_time().seconds()) +
                      1e-9 * caller.server_time().nanos() - here;
  DoctorLine line = {.check = "clock",
                     .text = absl::StrFormat("the server's is %.1f s %s", std::abs(skew),
                                             skew < 0 ? "behind" : "ahead")};
  if (std::abs(skew) > kNoticedSeconds) {
    line.finding = std::abs(skew) > kLeewaySeconds ? Finding::kFailed : Finding::kWarning;
    line.advice =
        "synchronize both clocks with NTP: the server's clock decides whether a token is valid";
  }
  report->Add(std::move(line));
  return true;
}

void DoctorCalls::CheckServer(DoctorReport* report) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ServerInfo info;
  const absl::Status status =
      FromGrpcStatus(v1::ServerInfoService::NewStub(channel_)->GetServerInfo(&context, {}, &info));
  if (!status.ok()) return report->Add(FailedCall("version", "", status));
  const std::string node = NodeOf(context);
  routes_.Remember("", node);
  DoctorLine version = {
      .check = "version",
      .text = absl::StrCat(
          "server ", info.version(), node.empty() ? "" : absl::StrCat(" (", node, " in a cluster)"),
          ", this program ", SoftwareVersion(), ", protocol ", info.api_version())};
  if (info.version() != SoftwareVersion()) {
    version.finding = Finding::kWarning;
    version.advice = "they are compatible; for all features install the same version";
  }
  report->Add(std::move(version));
  std::map<std::string, int64_t> limits;
  for (const v1::ServerLimit& limit : info.limits()) limits[limit.name()] = limit.value();
  report->Add(
      {.check = "limits",
       .text = absl::StrCat("meshes up to ", limits["max_vertices"], " vertices and ",
                            limits["max_mesh_bytes"] >> 20, " MiB, ", limits["max_sessions"],
                            " sessions in memory, ", limits["max_streams"], " drags at once")});
  if (info.draining()) {
    report->Add({.check = "limits",
                 .finding = Finding::kFailed,
                 .text = "the server is shutting down and accepts no new work",
                 .advice = "try again in a minute, or another server"});
  }
}

DoctorLine DoctorCalls::CheckWork() {
  constexpr char kCheck[] = "work";
  const Stopwatch watch;
  const absl::StatusOr<TetMesh> tets = TwoTets();
  if (!tets.ok()) return FailedCall(kCheck, "mesh of two tets: ", tets.status());
  const auto meshes = v1::MeshService::NewStub(channel_);
  const MeshPayloadView payload = ViewMeshPayload(tets->positions(), tets->tets(), {});
  UploadOptions upload;
  upload.give_up_after = kCallDeadline;
  const auto mesh = SendMesh(meshes.get(), payload, payload.Sha256(), kCallDeadline, upload);
  if (!mesh.ok()) return FailedCall(kCheck, "upload: ", mesh.status());
  v1::Session session;
  v1::CreateSessionRequest request = ToProto(RequestOf(mesh->name()));
  const auto sessions = v1::SessionService::NewStub(channel_);
  const absl::Status made =
      RunSessionCall(&routes_, "", PrepareToRepeat(routes_, &request), Deadline(),
                     [&](grpc::ClientContext* context) {
                       grpc::Status status = sessions->CreateSession(context, request, &session);
                       if (status.ok()) routes_.Remember(session.name(), NodeOf(*context));
                       return status;
                     });
  absl::Status dragged;
  if (made.ok()) {
    dragged = DragOnce(v1::DeformService::NewStub(channel_).get(), &routes_, session.name());
  }
  Delete(mesh->name(), session.name());
  if (!made.ok()) return FailedCall(kCheck, "session: ", made);
  if (!dragged.ok()) return FailedCall(kCheck, "drag: ", dragged);
  return {.check = kCheck,
          .text = absl::StrFormat(
              "uploaded two tets, created a session, dragged and deleted it in %.0f ms",
              watch.Seconds() * 1e3)};
}

void DoctorCalls::Delete(const std::string& mesh, const std::string& session) {
  google::protobuf::Empty ignored;
  if (!session.empty()) {
    v1::DeleteSessionRequest request;
    request.set_name(session);
    const auto sessions = v1::SessionService::NewStub(channel_);
    RunDeletion(&routes_, session, Deadline(), [&](grpc::ClientContext* context) {
      return sessions->DeleteSession(context, request, &ignored);
    }).IgnoreError();
  }
  v1::DeleteMeshRequest request;
  request.set_name(mesh);
  const auto meshes = v1::MeshService::NewStub(channel_);
  RunDeletion(&routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return meshes->DeleteMesh(context, request, &ignored);
  }).IgnoreError();
}

}  // namespace tissueform
