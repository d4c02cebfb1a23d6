// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/call_scope.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/ascii.h"
#include "grpcpp/server_context.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "server/auth/identity.h"
#include "server/rpc/status_conversion.h"

namespace tissueform {
namespace {

constexpr size_t kMaxRequestIdBytes = 64;

std::string_view RequestIdHeader(const grpc::CallbackServerContext* context) {
  if (context == nullptr) return {};
  const auto found = context->client_metadata().find(kRequestIdHeader);
  if (found == context->client_metadata().end()) return {};
  return {found->second.data(), found->second.size()};
}

}  // namespace

bool ServiceGate::WaitUntilIdle(std::chrono::steady_clock::time_point deadline) {
  MutexLock lock(mutex_);
  while (open_calls_ > 0) {
    if (!idle_.WaitUntil(mutex_, deadline)) {
      return open_calls_ == 0;
    }
  }
  return true;
}

void ServiceGate::Enter() {
  MutexLock lock(mutex_);
  ++open_calls_;
}

void ServiceGate::Leave() {
  MutexLock lock(mutex_);
  if (--open_calls_ == 0) {
    idle_.NotifyAll();
  }
}

std::string RequestIdOr(std::string_view from_client) {
  const bool well_formed = !from_client.empty() && from_client.size() <= kMaxRequestIdBytes &&
                           std::all_of(from_client.begin(), from_client.end(), [](unsigned char c) {
                             return absl::ascii_isalnum(c) || c == '-' || c == '_' || c == '.';
                           });
  return well_formed ? std::string(from_client) : RandomId();
}

CallScope::CallScope(const grpc::CallbackServerContext* context, std::string_view method,
                     CallKind kind, ServiceGate* gate)
    : method_(method),
      gate_(gate),
      start_(std::chrono::steady_clock::now()),
      request_id_(RequestIdOr(RequestIdHeader(context))) {
  gate_->Enter();
  if (kind == CallKind::kNewWork && gate_->draining()) {
    admission_ = WithReason(
        absl::UnavailableError(
            "the server is draining and takes no new work; try another one, or again in a minute"),
        ErrorReason::kServerDraining);
  }
}

CallScope::CallScope(CallScope&& other) noexcept
    : method_(other.method_),
      gate_(std::exchange(other.gate_, nullptr)),
      start_(other.start_),
      principal_(std::move(other.principal_)),
      request_id_(std::move(other.request_id_)),
      admission_(std::move(other.admission_)) {}

CallScope::~CallScope() {
  if (gate_ == nullptr) return;
  spdlog::warn("{} was left without an outcome, request {}", method_, request_id_);
  gate_->Leave();
}

grpc::Status CallScope::End(const absl::Status& outcome) {
  const std::chrono::duration<double, std::milli> elapsed =
      std::chrono::steady_clock::now() - start_;
  const auto level = outcome.ok() || outcome.code() == absl::StatusCode::kCancelled
                         ? spdlog::level::debug
                         : spdlog::level::info;
  spdlog::log(level, "{} {} {:.1f} ms, request {}", method_,
              absl::StatusCodeToString(outcome.code()), elapsed.count(), request_id_);
  std::exchange(gate_, nullptr)->Leave();
  return ToGrpcStatus(outcome);
}

grpc::ServerUnaryReactor* RunUpkeep(
    grpc::CallbackServerContext* context, std::string_view method, ServiceGate* gate,
    const std::function<absl::Status(const CallScope& scope, const EndCall& end)>& start) {
  auto scope = std::make_shared<CallScope>(context, method, CallKind::kUpkeep, gate);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const EndCall end = [scope, reactor](const absl::Status& outcome) {
    reactor->Finish(scope->End(outcome));
  };
  const absl::Status started = scope->admission().ok() ? start(*scope, end) : scope->admission();
  if (!started.ok()) end(started);
  return reactor;
}

}  // namespace tissueform
