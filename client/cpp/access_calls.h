// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/channel.h"

#include "client/cpp/session_routes.h"
#include "tissueform/v1/access_service.grpc.pb.h"

namespace tissueform {

// Who one is on a server, and who else may do what with one's own: the rpcs of AccessService. Got
// from TissueformClient, whose contract it shares: calls block, each with a deadline, and errors
// carry the server's code, message and reason.
//
// Thread-safe.
class AccessCalls {
 public:
  AccessCalls(const std::shared_ptr<grpc::Channel>& channel,
              std::chrono::milliseconds call_deadline, SessionRoutes* routes);

  absl::StatusOr<v1::Caller> WhoAmI();

  absl::StatusOr<v1::Share> Share(const v1::Share& share);
  absl::StatusOr<std::vector<v1::Share>> ListShares(const std::string& resource);
  absl::Status DeleteShare(const std::string& resource, const std::string& principal);

  // `case_name`: what the link opens beside its session; empty: nothing. `lifetime` is the server's
  // usual one when it is not set.
  absl::StatusOr<v1::FollowLink> CreateFollowLink(const std::string& session,
                                                  const std::string& case_name,
                                                  std::optional<std::chrono::seconds> lifetime);
  absl::Status DeleteFollowLinks(const std::string& session);

  // As GetUsageRequest.principal.
  absl::StatusOr<v1::Usage> GetUsage(const std::string& principal);

 private:
  std::chrono::system_clock::time_point Deadline() const;
  void SetDeadline(grpc::ClientContext* context) const;

  const std::chrono::milliseconds call_deadline_;
  SessionRoutes* const routes_;
  const std::unique_ptr<v1::AccessService::Stub> stub_;
};

}  // namespace tissueform
