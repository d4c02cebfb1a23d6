// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <utility>

#include "server/access/access_changes.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/access_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.AccessService. Stateless; all pointers must outlive it.
class AccessService final : public v1::AccessService::CallbackService {
 public:
  AccessService(AdmissionControl* gate, AccessChanges* changes, SessionRegistry* registry,
                const DeformStreams* streams, const SessionWatches* watches,
                UnixClock clock = SystemUnixSeconds)
      : gate_(gate),
        changes_(changes),
        registry_(registry),
        streams_(streams),
        watches_(watches),
        clock_(std::move(clock)) {}

  grpc::ServerUnaryReactor* WhoAmI(grpc::CallbackServerContext* context,
                                   const v1::WhoAmIRequest* request, v1::Caller* response) override;
  grpc::ServerUnaryReactor* CreateShare(grpc::CallbackServerContext* context,
                                        const v1::CreateShareRequest* request,
                                        v1::Share* response) override;
  grpc::ServerUnaryReactor* ListShares(grpc::CallbackServerContext* context,
                                       const v1::ListSharesRequest* request,
                                       v1::ListSharesResponse* response) override;
  grpc::ServerUnaryReactor* DeleteShare(grpc::CallbackServerContext* context,
                                        const v1::DeleteShareRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* CreateFollowLink(grpc::CallbackServerContext* context,
                                             const v1::CreateFollowLinkRequest* request,
                                             v1::FollowLink* response) override;
  grpc::ServerUnaryReactor* DeleteFollowLinks(grpc::CallbackServerContext* context,
                                              const v1::DeleteFollowLinksRequest* request,
                                              google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* GetUsage(grpc::CallbackServerContext* context,
                                     const v1::GetUsageRequest* request,
                                     v1::Usage* response) override;

 private:
  // All block on the store.
  absl::Status MakeLink(CallScope* scope, const v1::CreateFollowLinkRequest& request,
                        v1::FollowLink* response);
  absl::Status ReportUsage(const Principal& caller, const v1::GetUsageRequest& request,
                           v1::Usage* response) const;
  absl::StatusOr<std::map<std::string, v1::PrincipalUsage>> CollectUsage() const;

  AdmissionControl* const gate_;
  AccessChanges* const changes_;
  SessionRegistry* const registry_;
  const DeformStreams* const streams_;
  const SessionWatches* const watches_;
  const UnixClock clock_;
};

}  // namespace tissueform
