// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/builds/build_room.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/plan_build_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.PlanBuildService over a store of files, drafts and a queue. Files and builds belong
// to the user who sent them, and to no other user; a draft in a shared project is also open to the
// users of that share. All pointers must outlive it.
class PlanBuildService final : public v1::PlanBuildService::CallbackService {
 public:
  // `room` null: the server builds no plans. `keeps_drafts`: whether those who share a draft call
  // this server, too.
  PlanBuildService(AdmissionControl* gate, const ServiceLimits& limits, Access* access,
                   BuildRoom* room, bool keeps_drafts, WorkerPool* pool, DeadlineTimer* timer)
      : gate_(gate),
        limits_(limits),
        access_(access),
        files_(room == nullptr ? nullptr : room->files()),
        drafts_(room == nullptr ? nullptr : room->drafts()),
        builds_(room == nullptr ? nullptr : room->builds()),
        keeps_drafts_(keeps_drafts),
        pool_(pool),
        timer_(timer) {}

  grpc::ServerReadReactor<v1::UploadBuildFileRequest>* UploadBuildFile(
      grpc::CallbackServerContext* context, v1::BuildFile* response) override;
  grpc::ServerUnaryReactor* GetBuildFile(grpc::CallbackServerContext* context,
                                         const v1::GetBuildFileRequest* request,
                                         v1::BuildFile* response) override;
  grpc::ServerUnaryReactor* DeleteBuildFile(grpc::CallbackServerContext* context,
                                            const v1::DeleteBuildFileRequest* request,
                                            google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* CreatePlanBuild(grpc::CallbackServerContext* context,
                                            const v1::CreatePlanBuildRequest* request,
                                            v1::PlanBuild* response) override;
  grpc::ServerUnaryReactor* GetPlanBuild(grpc::CallbackServerContext* context,
                                         const v1::GetPlanBuildRequest* request,
                                         v1::PlanBuild* response) override;
  grpc::ServerUnaryReactor* ListPlanBuilds(grpc::CallbackServerContext* context,
                                           const v1::ListPlanBuildsRequest* request,
                                           v1::ListPlanBuildsResponse* response) override;
  grpc::ServerWriteReactor<v1::PlanBuild>* WatchPlanBuild(
      grpc::CallbackServerContext* context, const v1::WatchPlanBuildRequest* request) override;
  grpc::ServerUnaryReactor* CancelPlanBuild(grpc::CallbackServerContext* context,
                                            const v1::CancelPlanBuildRequest* request,
                                            v1::PlanBuild* response) override;
  grpc::ServerUnaryReactor* DeletePlanBuild(grpc::CallbackServerContext* context,
                                            const v1::DeletePlanBuildRequest* request,
                                            google::protobuf::Empty* response) override;
  grpc::ServerWriteReactor<v1::ReadPlanBuildFileResponse>* ReadPlanBuildFile(
      grpc::CallbackServerContext* context, const v1::ReadPlanBuildFileRequest* request) override;

  // In build_draft_calls.cc.
  grpc::ServerUnaryReactor* CreateBuildDraft(grpc::CallbackServerContext* context,
                                             const v1::CreateBuildDraftRequest* request,
                                             v1::BuildDraft* response) override;
  grpc::ServerUnaryReactor* GetBuildDraft(grpc::CallbackServerContext* context,
                                          const v1::GetBuildDraftRequest* request,
                                          v1::BuildDraft* response) override;
  grpc::ServerUnaryReactor* ListBuildDrafts(grpc::CallbackServerContext* context,
                                            const v1::ListBuildDraftsRequest* request,
                                            v1::ListBuildDraftsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteBuildDraft(grpc::CallbackServerContext* context,
                                             const v1::DeleteBuildDraftRequest* request,
                                             google::protobuf::Empty* response) override;
  grpc::ServerWriteReactor<v1::ReadBuildDraftResponse>* ReadBuildDraft(
      grpc::CallbackServerContext* context, const v1::ReadBuildDraftRequest* request) override;

 private:
  // `work` with the caller's name, in the lane of the store; an error where no plans are built.
  using Work = std::function<absl::Status(CallScope* scope, const std::string& owner)>;
  grpc::ServerUnaryReactor* Handle(grpc::CallbackServerContext* context, std::string_view method,
                                   Work work);

  // The draft, which the caller may use so. Errors: NotFound, PermissionDenied.
  absl::StatusOr<v1::BuildDraft> FindDraft(const Principal& caller, const std::string& name,
                                           Permission need);
  // Gives the caller the CT of the draft, and the request its name.
  absl::Status TakeDraft(const Principal& caller, v1::CreatePlanBuildRequest* request);
  absl::StatusOr<v1::ListBuildDraftsResponse> ListDrafts(const Principal& caller,
                                                         const v1::ListBuildDraftsRequest& request);
  absl::StatusOr<OpenFile> OpenDraft(CallScope* scope, const v1::ReadBuildDraftRequest& request);

  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  BuildFiles* const files_;
  BuildDrafts* const drafts_;
  PlanBuilds* const builds_;
  const bool keeps_drafts_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
