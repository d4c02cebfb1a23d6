// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/plan_build_service.h"

#include <chrono>
#include <fcntl.h>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/plan_build_conversion.h"
#include "server/builds/plan_builder.h"
#include "server/platform/storage/durable_file.h"
#include "server/rpc/build_file_upload_stream.h"
#include "server/rpc/calls/file_stream.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

// How often a watch sends the state and rechecks the authorization of its caller.
constexpr std::chrono::milliseconds kWatchPeriod = kReauthorizePeriod;

bool IsDone(const v1::PlanBuild& build) {
  return build.state() != v1::PLAN_BUILD_STATE_WAITING &&
         build.state() != v1::PLAN_BUILD_STATE_RUNNING;
}

absl::StatusOr<OpenFile> OpenBuiltFile(PlanBuilds* builds, CallScope* scope,
                                       const v1::ReadPlanBuildFileRequest& request) {
  if (builds == nullptr) return NoPlanBuilds();
  TF_ASSIGN_OR_RETURN(const std::string id, ParsePlanBuildName(request.name()));
  TF_ASSIGN_OR_RETURN(const std::string path,
                      builds->PathOf(scope->principal().name, id, request.path()));
  scope->SetResource(request.name());
  return OpenFile::Open(path, O_RDONLY);
}

// What a watch needs to ask again.
struct Watched {
  PlanBuilds* builds;
  std::string owner;
  std::string id;
  std::function<absl::Status()> is_authorized;
  bool is_over = false;
};

absl::StatusOr<bool> NextState(Watched* watched, v1::PlanBuild* message) {
  if (watched->is_over) return false;
  TF_RETURN_IF_ERROR(watched->is_authorized());
  TF_ASSIGN_OR_RETURN(*message, watched->builds->Find(watched->owner, watched->id));
  watched->is_over = IsDone(*message);
  return true;
}

}  // namespace

grpc::ServerUnaryReactor* PlanBuildService::Handle(grpc::CallbackServerContext* context,
                                                   std::string_view method, Work work) {
  return HandleStoreCall(context, method, gate_, pool_,
                         [this, work = std::move(work)](CallScope* scope) -> absl::Status {
                           if (builds_ == nullptr) return NoPlanBuilds();
                           return work(scope, scope->principal().name);
                         });
}

grpc::ServerReadReactor<v1::UploadBuildFileRequest>* PlanBuildService::UploadBuildFile(
    grpc::CallbackServerContext* context, v1::BuildFile* response) {
  auto* call = new BuildFileUploadStream(
      CallScope(context, "PlanBuildService.UploadBuildFile", CallKind::kNewWork, gate_), limits_,
      access_, files_, pool_, timer_, response);
  call->Start();
  return call;
}

grpc::ServerUnaryReactor* PlanBuildService::GetBuildFile(grpc::CallbackServerContext* context,
                                                         const v1::GetBuildFileRequest* request,
                                                         v1::BuildFile* response) {
  return Handle(context, "PlanBuildService.GetBuildFile",
                [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const std::string sha256,
                                      ParseBuildFileName(request->name()));
                  TF_ASSIGN_OR_RETURN(const BuildFileRecord arrived, files_->Ask(owner, sha256));
                  scope->SetResource(request->name());
                  *response = ToProto(arrived, files_->ExpiresS(arrived));
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::DeleteBuildFile(
    grpc::CallbackServerContext* context, const v1::DeleteBuildFileRequest* request,
    google::protobuf::Empty* /*response*/) {
  return Handle(context, "PlanBuildService.DeleteBuildFile",
                [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const std::string sha256,
                                      ParseBuildFileName(request->name()));
                  TF_RETURN_IF_ERROR(files_->Remove(owner, sha256));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::CreatePlanBuild(
    grpc::CallbackServerContext* context, const v1::CreatePlanBuildRequest* request,
    v1::PlanBuild* response) {
  return Handle(
      context, "PlanBuildService.CreatePlanBuild",
      [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
        TF_RETURN_IF_ERROR(CheckPlanBuildRequest(*request));
        TF_RETURN_IF_ERROR(Access::CheckProjectAccess(scope->principal(), request->project()));
        TF_RETURN_IF_ERROR(CheckPlanBuildPrograms());
        v1::CreatePlanBuildRequest asked = *request;
        if (!asked.draft().empty()) TF_RETURN_IF_ERROR(TakeDraft(scope->principal(), &asked));
        TF_ASSIGN_OR_RETURN(*response, builds_->Create(owner, asked));
        scope->SetResource(response->name());
        return absl::OkStatus();
      });
}

grpc::ServerUnaryReactor* PlanBuildService::GetPlanBuild(grpc::CallbackServerContext* context,
                                                         const v1::GetPlanBuildRequest* request,
                                                         v1::PlanBuild* response) {
  return Handle(context, "PlanBuildService.GetPlanBuild",
                [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const std::string id, ParsePlanBuildName(request->name()));
                  TF_ASSIGN_OR_RETURN(*response, builds_->Find(owner, id));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::ListPlanBuilds(grpc::CallbackServerContext* context,
                                                           const v1::ListPlanBuildsRequest* request,
                                                           v1::ListPlanBuildsResponse* response) {
  return Handle(context, "PlanBuildService.ListPlanBuilds",
                [=, this](CallScope* /*scope*/, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const PageRequest page,
                                      ReadPageRequest(request->page_size(), request->page_token()));
                  PlanBuilds::Page found = builds_->List(owner, page.after, page.size);
                  for (v1::PlanBuild& build : found.builds) {
                    *response->add_builds() = std::move(build);
                  }
                  response->set_next_page_token(found.next);
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::CancelPlanBuild(
    grpc::CallbackServerContext* context, const v1::CancelPlanBuildRequest* request,
    v1::PlanBuild* response) {
  return Handle(context, "PlanBuildService.CancelPlanBuild",
                [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const std::string id, ParsePlanBuildName(request->name()));
                  TF_ASSIGN_OR_RETURN(*response, builds_->Cancel(owner, id));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::DeletePlanBuild(
    grpc::CallbackServerContext* context, const v1::DeletePlanBuildRequest* request,
    google::protobuf::Empty* /*response*/) {
  return Handle(context, "PlanBuildService.DeletePlanBuild",
                [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(const std::string id, ParsePlanBuildName(request->name()));
                  TF_RETURN_IF_ERROR(builds_->Remove(owner, id));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

grpc::ServerWriteReactor<v1::PlanBuild>* PlanBuildService::WatchPlanBuild(
    grpc::CallbackServerContext* context, const v1::WatchPlanBuildRequest* request) {
  auto* call = new MessageStream<v1::PlanBuild>(
      CallScope(context, "PlanBuildService.WatchPlanBuild", CallKind::kMetadata, gate_),
      CancelOf(context), timer_, limits_.upload_silence);
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  const absl::StatusOr<std::string> id = ParsePlanBuildName(request->name());
  if (builds_ == nullptr || !id.ok()) {
    call->End(builds_ == nullptr ? NoPlanBuilds() : id.status());
    return call;
  }
  call->scope().SetResource(request->name());
  Watched watched{.builds = builds_,
                  .owner = call->scope().principal().name,
                  .id = *id,
                  .is_authorized = call->scope().AuthorizationQuestion()};
  // The first at once, the others when it is time for them; all where the disk may be waited for.
  const auto due =
      std::make_shared<std::chrono::steady_clock::time_point>(std::chrono::steady_clock::now());
  const auto post = [pool = pool_, timer = timer_, due](std::function<void()> job) {
    timer->Start(std::exchange(*due, *due + kWatchPeriod),
                 [pool, job = std::move(job)] { pool->Post(Lane::kStore, job); });
  };
  call->Send([watched = std::move(watched)](
                 v1::PlanBuild* message) mutable { return NextState(&watched, message); },
             post);
  return call;
}

grpc::ServerWriteReactor<v1::ReadPlanBuildFileResponse>* PlanBuildService::ReadPlanBuildFile(
    grpc::CallbackServerContext* context, const v1::ReadPlanBuildFileRequest* request) {
  auto* call = new MessageStream<v1::ReadPlanBuildFileResponse>(
      CallScope(context, "PlanBuildService.ReadPlanBuildFile", CallKind::kMetadata, gate_),
      CancelOf(context), timer_, limits_.upload_silence);
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  SendFile(call, pool_, limits_.max_chunk_bytes, [call, request, builds = builds_] {
    return OpenBuiltFile(builds, &call->scope(), *request);
  });
  return call;
}

}  // namespace tissueform
