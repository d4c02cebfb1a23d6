// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <map>
#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/plan_build_conversion.h"
#include "server/builds/plan_builder.h"
#include "server/rpc/calls/file_stream.h"
#include "server/rpc/plan_build_service.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

absl::Status NoDrafts() {
  return absl::FailedPreconditionError(
      "a server of a cluster keeps no drafts: others would not find them; give the bridge a rule "
      "that builds the plan, or a server of its own");
}

}  // namespace

absl::StatusOr<v1::BuildDraft> PlanBuildService::FindDraft(const Principal& caller,
                                                           const std::string& name,
                                                           Permission need) {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseBuildDraftName(name));
  TF_ASSIGN_OR_RETURN(v1::BuildDraft draft, drafts_->Find(id));
  TF_RETURN_IF_ERROR(access_->CheckProjectItemAccess(
      caller, {.owner = draft.principal(), .name = draft.project()}, NoBuildDraft(id), need));
  return draft;
}

absl::Status PlanBuildService::TakeDraft(const Principal& caller,
                                         v1::CreatePlanBuildRequest* request) {
  TF_ASSIGN_OR_RETURN(const v1::BuildDraft draft,
                      FindDraft(caller, request->draft(), Permission::kWrite));
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseBuildFileName(draft.ct()));
  TF_RETURN_IF_ERROR(access_->CheckStorageQuota(caller, draft.total_bytes()));
  TF_RETURN_IF_ERROR(files_->Adopt(draft.principal(), sha256, caller.name).status());
  request->set_ct(draft.ct());
  return absl::OkStatus();
}

grpc::ServerUnaryReactor* PlanBuildService::CreateBuildDraft(
    grpc::CallbackServerContext* context, const v1::CreateBuildDraftRequest* request,
    v1::BuildDraft* response) {
  return Handle(
      context, "PlanBuildService.CreateBuildDraft",
      [=, this](CallScope* scope, const std::string& owner) -> absl::Status {
        if (!keeps_drafts_) return NoDrafts();
        TF_RETURN_IF_ERROR(CheckBuildDraftRequest(*request));
        TF_RETURN_IF_ERROR(Access::CheckProjectAccess(scope->principal(), request->project()));
        TF_ASSIGN_OR_RETURN(*response, drafts_->Create(owner, *request));
        scope->SetResource(response->name());
        return absl::OkStatus();
      });
}

grpc::ServerUnaryReactor* PlanBuildService::GetBuildDraft(grpc::CallbackServerContext* context,
                                                          const v1::GetBuildDraftRequest* request,
                                                          v1::BuildDraft* response) {
  return Handle(context, "PlanBuildService.GetBuildDraft",
                [=, this](CallScope* scope, const std::string& /*owner*/) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(
                      *response, FindDraft(scope->principal(), request->name(), Permission::kRead));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

absl::StatusOr<v1::ListBuildDraftsResponse> PlanBuildService::ListDrafts(
    const Principal& caller, const v1::ListBuildDraftsRequest& request) {
  TF_ASSIGN_OR_RETURN(const PageRequest page,
                      ReadPageRequest(request.page_size(), request.page_token()));
  TF_ASSIGN_OR_RETURN(const auto shared, access_->SharedProjects(caller));
  const auto may_see = [&](const v1::BuildDraft& draft) {
    return draft.principal() == caller.name ||
           shared.contains({.owner = draft.principal(), .name = draft.project()});
  };
  v1::ListBuildDraftsResponse response;
  for (v1::BuildDraft& draft : drafts_->List()) {
    const absl::StatusOr<std::string> id = ParseBuildDraftName(draft.name());
    if (!id.ok() || *id <= page.after || !may_see(draft)) continue;
    if (response.drafts_size() == page.size) {
      const auto& last = response.drafts(response.drafts_size() - 1);
      TF_ASSIGN_OR_RETURN(*response.mutable_next_page_token(), ParseBuildDraftName(last.name()));
      break;
    }
    draft.clear_recipe_json();
    *response.add_drafts() = std::move(draft);
  }
  return response;
}

grpc::ServerUnaryReactor* PlanBuildService::ListBuildDrafts(
    grpc::CallbackServerContext* context, const v1::ListBuildDraftsRequest* request,
    v1::ListBuildDraftsResponse* response) {
  return Handle(context, "PlanBuildService.ListBuildDrafts",
                [=, this](CallScope* scope, const std::string& /*owner*/) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(*response, ListDrafts(scope->principal(), *request));
                  return absl::OkStatus();
                });
}

grpc::ServerUnaryReactor* PlanBuildService::DeleteBuildDraft(
    grpc::CallbackServerContext* context, const v1::DeleteBuildDraftRequest* request,
    google::protobuf::Empty* /*response*/) {
  return Handle(context, "PlanBuildService.DeleteBuildDraft",
                [=, this](CallScope* scope, const std::string& /*owner*/) -> absl::Status {
                  TF_ASSIGN_OR_RETURN(
                      const v1::BuildDraft draft,
                      FindDraft(scope->principal(), request->name(), Permission::kWrite));
                  TF_RETURN_IF_ERROR(builds_->RemoveDraft(draft));
                  scope->SetResource(request->name());
                  return absl::OkStatus();
                });
}

absl::StatusOr<OpenFile> PlanBuildService::OpenDraft(CallScope* scope,
                                                     const v1::ReadBuildDraftRequest& request) {
  if (drafts_ == nullptr) return NoPlanBuilds();
  TF_ASSIGN_OR_RETURN(const v1::BuildDraft draft,
                      FindDraft(scope->principal(), request.name(), Permission::kRead));
  scope->SetResource(request.name());
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseBuildFileName(draft.ct()));
  return files_->OpenWhole(draft.principal(), sha256);
}

grpc::ServerWriteReactor<v1::ReadBuildDraftResponse>* PlanBuildService::ReadBuildDraft(
    grpc::CallbackServerContext* context, const v1::ReadBuildDraftRequest* request) {
  auto* call = new MessageStream<v1::ReadBuildDraftResponse>(
      CallScope(context, "PlanBuildService.ReadBuildDraft", CallKind::kMetadata, gate_),
      CancelOf(context), timer_, limits_.upload_silence);
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  SendFile(call, pool_, limits_.max_chunk_bytes,
           [this, call, request] { return OpenDraft(&call->scope(), *request); });
  return call;
}

}  // namespace tissueform
