// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/call_scope.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "grpcpp/security/auth_context.h"
#include "grpcpp/server_context.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "proto/conversion/session_conversion.h"
#include "server/access/auth/identity.h"
#include "server/platform/log_lines.h"
#include "server/rpc/calls/client_address.h"
#include "server/rpc/calls/status_conversion.h"

namespace tissueform {
namespace {

constexpr char kAuthorizationHeader[] = "authorization";
constexpr size_t kMaxRequestIdBytes = 64;

std::string_view Header(const grpc::CallbackServerContext* context, const char* name) {
  if (context == nullptr) return {};
  const auto found = context->client_metadata().find(name);
  if (found == context->client_metadata().end()) return {};
  return {found->second.data(), found->second.size()};
}

Credentials CredentialsOf(const grpc::CallbackServerContext* context) {
  Credentials credentials;
  if (context == nullptr) return credentials;
  const auto [begin, end] = context->client_metadata().equal_range(kAuthorizationHeader);
  for (auto header = begin; header != end; ++header) {
    credentials.authorization.emplace_back(header->second.data(), header->second.size());
  }
  const std::shared_ptr<const grpc::AuthContext> tls = context->auth_context();
  if (tls == nullptr || !tls->IsPeerAuthenticated()) return credentials;
  for (const grpc::string_ref& name : tls->GetPeerIdentity()) {
    credentials.certificate_names.emplace_back(name.data(), name.size());
  }
  return credentials;
}

// Says in the reply which server of the cluster answers. Errors: a call that is meant for another
// one; what it names goes nowhere from here.
absl::Status MeetNode(const std::string& node_name, grpc::CallbackServerContext* context) {
  if (node_name.empty() || context == nullptr) return absl::OkStatus();
  context->AddInitialMetadata(kNodeHeader, node_name);
  context->AddTrailingMetadata(kNodeHeader, node_name);
  const auto [begin, end] = context->client_metadata().equal_range(kNodeHeader);
  if (std::all_of(begin, end, [&](const auto& header) { return header.second == node_name; })) {
    return absl::OkStatus();
  }
  return WithReason(
      absl::UnavailableError(
          absl::StrCat("the header ", kNodeHeader, " names another server; call again without it")),
      ErrorReason::kWrongNode);
}

// As the W3C has it: "00-", 32 hexadecimal digits, "-", 16, "-", 2. Others go to no log.
std::string TraceparentOr(std::string_view from_client) {
  constexpr std::string_view kForm = "00-................................-................-..";
  if (from_client.size() != kForm.size()) return {};
  for (size_t i = 0; i < kForm.size(); ++i) {
    const char c = from_client[i];
    const bool digit = absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f');
    if (kForm[i] == '.' ? !digit : c != kForm[i]) return {};
  }
  return std::string(from_client);
}

std::shared_ptr<const Principal> Nobody() {
  static const auto* nobody =
      new std::shared_ptr<const Principal>(std::make_shared<const Principal>());
  return *nobody;
}

}  // namespace

bool AdmissionControl::WaitUntilIdle(std::chrono::steady_clock::time_point deadline) {
  MutexLock lock(mutex_);
  while (open_calls_ > 0) {
    if (!idle_.WaitUntil(mutex_, deadline)) {
      return open_calls_ == 0;
    }
  }
  return true;
}

void AdmissionControl::Enter() {
  MutexLock lock(mutex_);
  ++open_calls_;
}

void AdmissionControl::Leave() {
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

CallScope::CallScope(grpc::CallbackServerContext* context, std::string_view method, CallKind kind,
                     AdmissionControl* gate)
    : method_(method),
      kind_(kind),
      gate_(gate),
      start_(std::chrono::steady_clock::now()),
      authenticated_({.principal = Nobody()}),
      address_(ClientAddress(context, CredentialsOf(context), gate->checks().gateway_name)),
      request_id_(RequestIdOr(Header(context, kRequestIdHeader))),
      traceparent_(TraceparentOr(Header(context, "traceparent"))),
      admission_(Admit(context)) {}

absl::Status CallScope::Admit(grpc::CallbackServerContext* context) {
  gate_->Enter();
  TF_RETURN_IF_ERROR(MeetNode(gate_->checks().node_name, context));
  if (gate_->checks().authenticator != nullptr) {
    TF_ASSIGN_OR_RETURN(authenticated_,
                        gate_->checks().authenticator->Authenticate(CredentialsOf(context)));
    if (gate_->checks().may_call)
      TF_RETURN_IF_ERROR(gate_->checks().may_call(principal(), method_));
  }
  if (kind_ != CallKind::kMetadata && gate_->draining()) {
    return WithReason(absl::UnavailableError("the server is draining and accepts no new work; use "
                                             "another server, or try again in a minute"),
                      ErrorReason::kServerDraining);
  }
  if (gate_->checks().observer != nullptr)
    TF_RETURN_IF_ERROR(gate_->checks().observer->OnBegin(Observed()));
  if (gate_->checks().quotas != nullptr && !principal().anonymous()) {
    TF_RETURN_IF_ERROR(gate_->checks().quotas->Begin(principal().name, kind_));
    counted_ = true;
  }
  served_ = true;
  return absl::OkStatus();
}

CallScope::CallScope(CallScope&& other) noexcept
    : method_(other.method_),
      kind_(other.kind_),
      gate_(std::exchange(other.gate_, nullptr)),
      start_(other.start_),
      authenticated_(other.authenticated_),  // not moved: what is left still has a principal
      counted_(std::exchange(other.counted_, false)),
      address_(std::move(other.address_)),
      request_id_(std::move(other.request_id_)),
      traceparent_(std::move(other.traceparent_)),
      resource_(std::move(other.resource_)),
      served_(other.served_),
      admission_(std::move(other.admission_)) {}

ObservedCall CallScope::Observed() const {
  return {.method = method_,
          .kind = kind_,
          .principal = principal(),
          .resource = resource_,
          .address = address_,
          .request_id = request_id_,
          .traceparent = traceparent_,
          .served = served_};
}

absl::Status CallScope::Renew(const std::string& token) {
  if (gate_->checks().authenticator == nullptr) return absl::OkStatus();
  const std::string bearer = absl::StrCat("Bearer ", token);
  TF_ASSIGN_OR_RETURN(Authenticated renewed,
                      gate_->checks().authenticator->Authenticate({.authorization = {bearer}}));
  if (*renewed.principal != principal()) {
    return absl::UnauthenticatedError(
        "the new token has another principal or other rights; open a new stream with it");
  }
  authenticated_ = std::move(renewed);
  return absl::OkStatus();
}

void CallScope::RenewFrom(const Authenticated& other) {
  if (may_end_early() && *other.principal == principal() &&
      other.expires > authenticated_.expires) {
    authenticated_ = other;
  }
}

absl::Status CallScope::IsStillAuthorized() const { return AuthorizationQuestion()(); }

std::function<absl::Status()> CallScope::AuthorizationQuestion() const {
  if (!may_end_early()) return [] { return absl::OkStatus(); };
  return [authenticator = gate_->checks().authenticator, authenticated = authenticated_] {
    return authenticator->IsStillAuthorized(authenticated);
  };
}

void CallScope::SetResource(std::string resource) {
  resource_ = std::move(resource);
  if (gate_->checks().observer != nullptr) gate_->checks().observer->OnResource(Observed());
}

CallScope::~CallScope() {
  if (gate_ == nullptr) return;
  spdlog::warn("{} ended without an outcome, request {}", method_, request_id_);
  ReportEnd(absl::CancelledError("ended without an outcome"));
  gate_->Leave();
}

void CallScope::ReportEnd(const absl::Status& outcome) {
  if (std::exchange(counted_, false)) gate_->checks().quotas->End(principal().name, kind_);
  if (gate_->checks().observer == nullptr) return;
  gate_->checks().observer->OnEnd(Observed(), outcome, std::chrono::steady_clock::now() - start_);
}

grpc::Status CallScope::End(const absl::Status& outcome) {
  const std::chrono::duration<double, std::milli> elapsed =
      std::chrono::steady_clock::now() - start_;
  // Who knocks without being let in is counted, and logged, by the authenticator.
  const bool quiet = outcome.ok() || outcome.code() == absl::StatusCode::kCancelled ||
                     absl::IsUnauthenticated(admission_);
  const auto level = quiet ? spdlog::level::debug : spdlog::level::info;
  const std::string code = absl::StatusCodeToString(outcome.code());
  const CallOfLogLine call = {.request_id = request_id_,
                              .method = method_,
                              .code = code,
                              .duration = elapsed,
                              .traceparent = traceparent_};
  const LogLinesOfCall lines(call);
  spdlog::log(level, "{} {} {:.1f} ms, request {}", method_, code, elapsed.count(), request_id_);
  ReportEnd(outcome);
  std::exchange(gate_, nullptr)->Leave();
  return ToGrpcStatus(outcome);
}

grpc::ServerUnaryReactor* HandleUnaryCall(
    grpc::CallbackServerContext* context, std::string_view method, AdmissionControl* gate,
    const std::function<absl::Status(CallScope& scope, const FinishCall& end)>& start) {
  auto scope = std::make_shared<CallScope>(context, method, CallKind::kMetadata, gate);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const FinishCall end = [scope, reactor](const absl::Status& outcome) {
    reactor->Finish(scope->End(outcome));
  };
  const absl::Status started = scope->admission().ok() ? start(*scope, end) : scope->admission();
  if (!started.ok()) end(started);
  return reactor;
}

grpc::ServerUnaryReactor* HandleUnaryCallIn(
    Lane lane, WorkerPool* pool, grpc::CallbackServerContext* context, std::string_view method,
    AdmissionControl* gate,
    std::function<absl::Status(CallScope& scope, const FinishCall& end)> start) {
  return HandleUnaryCall(context, method, gate, [&](CallScope& scope, const FinishCall& end) {
    pool->Post(lane, [end, scope = &scope, start = std::move(start)] {
      if (const absl::Status started = start(*scope, end); !started.ok()) end(started);
    });
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* HandleStoreCall(grpc::CallbackServerContext* context,
                                          std::string_view method, AdmissionControl* gate,
                                          WorkerPool* pool,
                                          std::function<absl::Status(CallScope* scope)> work) {
  return HandleUnaryCall(context, method, gate, [&](CallScope& scope, const FinishCall& end) {
    pool->Post(Lane::kStore, [end, scope = &scope, work = std::move(work)] { end(work(scope)); });
    return absl::OkStatus();
  });
}

}  // namespace tissueform
