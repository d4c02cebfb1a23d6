// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/access_calls.h"

#include "client/cpp/client_call.h"
#include "client/cpp/session_call.h"
#include "core/base/status_macros.h"

namespace tissueform {

AccessCalls::AccessCalls(const std::shared_ptr<grpc::Channel>& channel,
                         std::chrono::milliseconds call_deadline, SessionRoutes* routes)
    : call_deadline_(call_deadline), routes_(routes), stub_(v1::AccessService::NewStub(channel)) {}

std::chrono::system_clock::time_point AccessCalls::Deadline() const {
  return std::chrono::system_clock::now() + call_deadline_;
}

void AccessCalls::SetDeadline(grpc::ClientContext* context) const {
  context->set_deadline(Deadline());
}

absl::StatusOr<v1::Caller> AccessCalls::WhoAmI() {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::Caller caller;
  TF_RETURN_IF_ERROR(EndOfCall(stub_->WhoAmI(&context, {}, &caller)));
  return caller;
}

absl::StatusOr<v1::Share> AccessCalls::Share(const v1::Share& share) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::CreateShareRequest request;
  *request.mutable_share() = share;
  v1::Share made;
  TF_RETURN_IF_ERROR(EndOfCall(stub_->CreateShare(&context, request, &made)));
  return made;
}

absl::StatusOr<std::vector<v1::Share>> AccessCalls::ListShares(const std::string& resource) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ListSharesRequest request;
  request.set_resource(resource);
  v1::ListSharesResponse response;
  TF_RETURN_IF_ERROR(EndOfCall(stub_->ListShares(&context, request, &response)));
  return std::vector<v1::Share>(response.shares().begin(), response.shares().end());
}

absl::Status AccessCalls::DeleteShare(const std::string& resource, const std::string& principal) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::DeleteShareRequest request;
  request.set_resource(resource);
  request.set_principal(principal);
  google::protobuf::Empty response;
  return EndOfCall(stub_->DeleteShare(&context, request, &response));
}

absl::StatusOr<v1::FollowLink> AccessCalls::CreateFollowLink(
    const std::string& session, const std::string& case_name,
    std::optional<std::chrono::seconds> lifetime) {
  v1::CreateFollowLinkRequest request;
  request.set_session(session);
  request.set_case_(case_name);
  if (lifetime.has_value()) request.mutable_lifetime()->set_seconds(lifetime->count());
  v1::FollowLink link;
  TF_RETURN_IF_ERROR(RunSessionCall(routes_, session, CallRepeat::kIfNothingWasDone, Deadline(),
                                    [&](grpc::ClientContext* context) {
                                      return stub_->CreateFollowLink(context, request, &link);
                                    }));
  return link;
}

absl::Status AccessCalls::DeleteFollowLinks(const std::string& session) {
  v1::DeleteFollowLinksRequest request;
  request.set_session(session);
  google::protobuf::Empty response;
  return RunSessionCall(routes_, session, CallRepeat::kAlways, Deadline(),
                        [&](grpc::ClientContext* context) {
                          return stub_->DeleteFollowLinks(context, request, &response);
                        });
}

absl::StatusOr<v1::Usage> AccessCalls::GetUsage(const std::string& principal) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::GetUsageRequest request;
  request.set_principal(principal);
  v1::Usage usage;
  TF_RETURN_IF_ERROR(EndOfCall(stub_->GetUsage(&context, request, &usage)));
  return usage;
}

}  // namespace tissueform
