// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/session_call.h"

#include <random>
#include <utility>

#include "absl/strings/str_format.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kAtOnce{0};

// The server was asked, and refused before it began.
bool NothingWasDone(const absl::Status& error) {
  return HasReason(error, ErrorReason::kSessionMoved) ||
         HasReason(error, ErrorReason::kWrongNode) ||
         HasReason(error, ErrorReason::kServerDraining);
}

// It is unknown whether the server did it.
bool IsLost(const absl::Status& error) {
  return absl::IsUnavailable(error) || absl::IsUnknown(error) || absl::IsInternal(error);
}

}  // namespace

SessionAttempts::SessionAttempts(SessionRoutes* routes, std::string session, CallRepeat repeat,
                                 std::chrono::milliseconds patience)
    : routes_(routes), session_(std::move(session)), repeat_(repeat), patience_(patience) {}

void SessionAttempts::AddHeaders(grpc::ClientContext* context) const {
  routes_->AddHeaders(session_, context);
  if (session_.empty() && !node_.empty()) context->AddMetadata(kNodeHeader, node_);
}

void SessionAttempts::Succeeded(const grpc::ClientContext& context) const {
  routes_->Remember(session_, NodeOf(context));
}

std::optional<std::chrono::milliseconds> SessionAttempts::AfterError(const absl::Status& error) {
  routes_->LearnFrom(error, session_);
  node_ = NodeIn(error);
  if (!node_.empty() && hops_ < kMaxHops) {
    ++hops_;
    return kAtOnce;
  }
  if (!routes_->in_cluster()) return std::nullopt;
  if (!NothingWasDone(error) && !(repeat_ == CallRepeat::kAlways && IsLost(error)))
    return std::nullopt;
  // Who has no patience waits between its calls.
  if (HasReason(error, ErrorReason::kSessionMoved) && node_.empty() && patience_ > kNoPatience &&
      !std::exchange(tried_at_once_, true)) {
    return kAtOnce;
  }
  return Wait(error);
}

std::optional<std::chrono::milliseconds> SessionAttempts::Wait(const absl::Status& error) {
  const auto now = std::chrono::steady_clock::now();
  if (!give_up_.has_value()) give_up_ = now + patience_;
  const std::chrono::milliseconds wait = backoff_.After(error);
  if (now + wait > *give_up_) return std::nullopt;
  return wait;
}

absl::Status RunSessionCall(SessionRoutes* routes, const std::string& session, CallRepeat repeat,
                            std::chrono::system_clock::time_point deadline,
                            const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
  SessionAttempts attempts(routes, session, repeat);
  while (true) {
    grpc::ClientContext context;
    context.set_deadline(deadline);
    attempts.AddHeaders(&context);
    const absl::Status status = EndOfCall(attempt(&context));
    if (status.ok()) {
      attempts.Succeeded(context);
      return status;
    }
    const std::optional<std::chrono::milliseconds> wait = attempts.AfterError(status);
    if (!wait.has_value() || std::chrono::system_clock::now() + *wait > deadline) return status;
    std::this_thread::sleep_for(*wait);
  }
}

absl::Status RunDeletion(SessionRoutes* routes, const std::string& session,
                         std::chrono::system_clock::time_point deadline,
                         const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
  bool lost = false;
  const absl::Status status = RunSessionCall(
      routes, session, CallRepeat::kAlways, deadline, [&](grpc::ClientContext* context) {
        grpc::Status deleted = attempt(context);
        // The attempt that was lost has done it.
        if (lost && deleted.error_code() == grpc::StatusCode::NOT_FOUND) return grpc::Status::OK;
        lost = lost || !deleted.ok();
        return deleted;
      });
  if (status.ok()) routes->Forget(session);
  return status;
}

CallRepeat PrepareToRepeat(const SessionRoutes& routes, v1::CreateSessionRequest* request) {
  if (request->request_id().empty() && routes.in_cluster()) {
    std::random_device random;
    request->set_request_id(
        absl::StrFormat("%08x%08x%08x%08x", random(), random(), random(), random()));
  }
  return request->request_id().empty() ? CallRepeat::kIfNothingWasDone : CallRepeat::kAlways;
}

// With an etag the one that was lost, if it was done, speaks against the next.
CallRepeat RepeatOf(const v1::UpdateSessionRequest& request) {
  return request.etag().empty() ? CallRepeat::kAlways : CallRepeat::kIfNothingWasDone;
}

}  // namespace tissueform
