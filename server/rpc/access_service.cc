// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/access_service.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "google/protobuf/util/time_util.h"

#include "core/base/status_macros.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/access/link_authenticator.h"
#include "server/rpc/allowed_resource.h"

namespace tissueform {
namespace {

using google::protobuf::util::TimeUtil;
using std::chrono::system_clock;

constexpr char kEverybody[] = "-";

google::protobuf::Timestamp ToTimestamp(system_clock::time_point time) {
  return TimeUtil::MillisecondsToTimestamp(
      std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count());
}

absl::StatusOr<ShareRow> ToShare(const v1::Share& proto) {
  ShareRow share{.resource = proto.resource(), .principal = proto.principal()};
  switch (proto.role()) {
    case v1::SHARE_ROLE_VIEWER:
      share.role = ShareRole::kViewer;
      return share;
    case v1::SHARE_ROLE_PLANNER:
      share.role = ShareRole::kPlanner;
      return share;
    default:
      return absl::InvalidArgumentError(
          "invalid share role; send SHARE_ROLE_VIEWER or SHARE_ROLE_PLANNER");
  }
}

v1::Share ToProto(const ShareRow& share) {
  v1::Share proto;
  proto.set_resource(share.resource);
  proto.set_principal(share.principal);
  proto.set_role(share.role == ShareRole::kPlanner ? v1::SHARE_ROLE_PLANNER
                                                   : v1::SHARE_ROLE_VIEWER);
  return proto;
}

absl::StatusOr<int64_t> LifetimeSeconds(const v1::CreateFollowLinkRequest& request,
                                        std::chrono::seconds most) {
  if (!request.has_lifetime()) return std::chrono::seconds(kUsualLinkLifetime).count();
  const int64_t seconds = request.lifetime().seconds();
  if (seconds > 0 && seconds <= most.count()) return seconds;
  return absl::InvalidArgumentError(absl::StrCat("lifetime is ", seconds, " s; it must be 1 to ",
                                                 most.count(), " (--max-link-hours)"));
}

absl::StatusOr<FollowLinkRow> ToLink(const v1::CreateFollowLinkRequest& request,
                                     const std::string& token, std::chrono::seconds most,
                                     int64_t now_s) {
  FollowLinkRow link{.digest = DigestOfLinkToken(token)};
  TF_ASSIGN_OR_RETURN(link.session, ParseSessionName(request.session()));
  if (!request.case_().empty()) {
    TF_ASSIGN_OR_RETURN(link.case_sha256, ParseCaseName(request.case_()));
  }
  TF_ASSIGN_OR_RETURN(const int64_t seconds, LifetimeSeconds(request, most));
  link.expires_s = now_s + seconds;
  return link;
}

// The principal whose usage the caller asks for; kEverybody: all of them.
absl::StatusOr<std::string> AskedPrincipal(const Principal& caller, const std::string& asked) {
  if (asked.empty() || asked == caller.name) return caller.name;
  if (!caller.anonymous() && !caller.roles.contains("admin")) {
    return absl::PermissionDeniedError(
        "usage of others requires the role admin; leave the principal out to see your own");
  }
  return asked;
}

}  // namespace

grpc::ServerUnaryReactor* AccessService::WhoAmI(grpc::CallbackServerContext* context,
                                                const v1::WhoAmIRequest* /*request*/,
                                                v1::Caller* response) {
  return HandleUnaryCall(context, "AccessService.WhoAmI", gate_,
                         [&](CallScope& scope, const FinishCall& end) -> absl::Status {
                           const Principal& caller = scope.principal();
                           response->set_principal(caller.name);
                           for (const std::string& role : caller.roles) response->add_roles(role);
                           for (const std::string& name : caller.projects)
                             response->add_projects(name);
                           response->set_only_session(caller.only_session);
                           const system_clock::time_point expires = scope.authenticated().expires;
                           if (expires != system_clock::time_point::max()) {
                             *response->mutable_expire_time() = ToTimestamp(expires);
                           }
                           *response->mutable_server_time() = ToTimestamp(system_clock::now());
                           end(absl::OkStatus());
                           return absl::OkStatus();
                         });
}

grpc::ServerUnaryReactor* AccessService::CreateShare(grpc::CallbackServerContext* context,
                                                     const v1::CreateShareRequest* request,
                                                     v1::Share* response) {
  return HandleStoreCall(context, "AccessService.CreateShare", gate_, &registry_->pool(),
                         [=, this](CallScope* scope) -> absl::Status {
                           TF_ASSIGN_OR_RETURN(const ShareRow share, ToShare(request->share()));
                           *response = ToProto(share);
                           scope->SetResource(share.resource);
                           return changes_->Share(scope->principal(), share);
                         });
}

grpc::ServerUnaryReactor* AccessService::ListShares(grpc::CallbackServerContext* context,
                                                    const v1::ListSharesRequest* request,
                                                    v1::ListSharesResponse* response) {
  return HandleStoreCall(context, "AccessService.ListShares", gate_, &registry_->pool(),
                         [=, this](CallScope* scope) -> absl::Status {
                           TF_ASSIGN_OR_RETURN(
                               const std::vector<ShareRow> shares,
                               changes_->SharesOf(scope->principal(), request->resource()));
                           scope->SetResource(request->resource());
                           for (const ShareRow& share : shares) {
                             *response->add_shares() = ToProto(share);
                           }
                           return absl::OkStatus();
                         });
}

grpc::ServerUnaryReactor* AccessService::DeleteShare(grpc::CallbackServerContext* context,
                                                     const v1::DeleteShareRequest* request,
                                                     google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(
      context, "AccessService.DeleteShare", gate_, &registry_->pool(), [=, this](CallScope* scope) {
        scope->SetResource(request->resource());
        return changes_->Unshare(scope->principal(), request->resource(), request->principal());
      });
}

grpc::ServerUnaryReactor* AccessService::CreateFollowLink(
    grpc::CallbackServerContext* context, const v1::CreateFollowLinkRequest* request,
    v1::FollowLink* response) {
  return HandleStoreCall(
      context, "AccessService.CreateFollowLink", gate_, &registry_->pool(),
      [=, this](CallScope* scope) { return MakeLink(scope, *request, response); });
}

absl::Status AccessService::MakeLink(CallScope* scope, const v1::CreateFollowLinkRequest& request,
                                     v1::FollowLink* response) {
  const std::string token = NewLinkToken();
  TF_ASSIGN_OR_RETURN(const FollowLinkRow link,
                      ToLink(request, token, changes_->options().max_link_lifetime, clock_()));
  TF_RETURN_IF_ERROR(
      AllowedSession(&changes_->access(), scope, request.session(), Permission::kWrite).status());
  TF_RETURN_IF_ERROR(changes_->AddLink(scope->principal(), link));
  response->set_token(token);
  response->mutable_expire_time()->set_seconds(link.expires_s);
  return absl::OkStatus();
}

grpc::ServerUnaryReactor* AccessService::DeleteFollowLinks(
    grpc::CallbackServerContext* context, const v1::DeleteFollowLinksRequest* request,
    google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(
      context, "AccessService.DeleteFollowLinks", gate_, &registry_->pool(),
      [=, this](CallScope* scope) -> absl::Status {
        TF_ASSIGN_OR_RETURN(
            const std::string id,
            AllowedSession(&changes_->access(), scope, request->session(), Permission::kWrite));
        return changes_->RemoveLinks(scope->principal(), id);
      });
}

grpc::ServerUnaryReactor* AccessService::GetUsage(grpc::CallbackServerContext* context,
                                                  const v1::GetUsageRequest* request,
                                                  v1::Usage* response) {
  return HandleStoreCall(
      context, "AccessService.GetUsage", gate_, &registry_->pool(),
      [=, this](CallScope* scope) { return ReportUsage(scope->principal(), *request, response); });
}

absl::Status AccessService::ReportUsage(const Principal& caller, const v1::GetUsageRequest& request,
                                        v1::Usage* response) const {
  TF_ASSIGN_OR_RETURN(const std::string asked, AskedPrincipal(caller, request.principal()));
  using UsageOf = std::map<std::string, v1::PrincipalUsage>;
  TF_ASSIGN_OR_RETURN(UsageOf usage, CollectUsage());
  if (asked != kEverybody) {
    v1::PrincipalUsage one = std::move(usage[asked]);
    usage.clear();
    usage[asked] = std::move(one);
  }
  for (auto& [name, of_name] : usage) {
    of_name.set_principal(name);
    *response->add_principals() = std::move(of_name);
  }
  std::stable_sort(response->mutable_principals()->begin(), response->mutable_principals()->end(),
                   [](const v1::PrincipalUsage& a, const v1::PrincipalUsage& b) {
                     return a.memory_bytes() > b.memory_bytes();
                   });
  return absl::OkStatus();
}

absl::StatusOr<std::map<std::string, v1::PrincipalUsage>> AccessService::CollectUsage() const {
  std::map<std::string, v1::PrincipalUsage> usage;
  using HoldingsOfAll = std::map<std::string, Holdings>;
  TF_ASSIGN_OR_RETURN(const HoldingsOfAll holdings, changes_->access().HoldingsByOwner());
  for (const auto& [owner, held] : holdings) {
    usage[owner].set_stored_sessions(held.sessions);
    usage[owner].set_disk_bytes(held.bytes);
  }
  for (const std::shared_ptr<Session>& session : registry_->table().Loaded()) {
    v1::PrincipalUsage& of_owner = usage[registry_->table().OwnerOf(session->id())];
    of_owner.set_sessions(of_owner.sessions() + 1);
    of_owner.set_memory_bytes(of_owner.memory_bytes() + session->bytes_held());
  }
  for (const auto& [name, count] : streams_->CountByPrincipal()) usage[name].set_streams(count);
  for (const auto& [name, count] : watches_->CountByPrincipal()) {
    usage[name].set_streams(usage[name].streams() + count);
  }
  return usage;
}

}  // namespace tissueform
