// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_routes.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "client/gateway/call_metadata.h"
#include "client/gateway/socket_call.h"
#include "client/gateway/web_call.h"
#include "client/gateway/web_frames.h"

namespace tissueform {
namespace {

// No inline script, nothing from elsewhere, text is never run; the page's own WebAssembly is. The
// identity provider may be asked, where there is one.
std::string SecurityPolicy(const LoginConfig& login) {
  const std::string provider = OriginOfIssuer(login);
  return absl::StrCat(
      "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; "
      "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'",
      provider.empty() ? "" : " ", provider,
      "; worker-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
      "frame-ancestors 'none'");
}

constexpr absl::string_view kExposedHeaders =
    "grpc-status, grpc-message, grpc-status-details-bin, x-tissueform-session, x-tissueform-node, "
    "traceparent";

constexpr absl::string_view kRequestHeaders =
    "content-type, x-grpc-web, x-user-agent, grpc-timeout, authorization, x-tissueform-session, "
    "x-tissueform-node, traceparent";

constexpr std::array<std::pair<int, absl::string_view>, 11> kSentences = {{
    {200, "ok\n"},
    {400, "invalid request\n"},
    {403, "this origin is not allowed; see --allow-origin\n"},
    {404, "not found\n"},
    {405, "method not allowed here\n"},
    {413, "the body is too large\n"},
    {415, "only binary gRPC-Web is supported: application/grpc-web+proto\n"},
    {421, "this host is not allowed; see --allow-host\n"},
    {426, "a WebSocket call needs the subprotocol tissueform.v1\n"},
    {431, "the header is too large\n"},
    {503, "no server accepts calls now, or the gateway is full; try again in a moment\n"},
}};

bool IsReading(const HttpHead& head) { return head.method == "GET" || head.method == "HEAD"; }

bool OffersSubprotocol(const HttpHead& head) {
  for (const auto& [name, value] : head.fields) {
    if (name != "sec-websocket-protocol") continue;
    for (const absl::string_view offered : absl::StrSplit(value, ',')) {
      if (absl::StripAsciiWhitespace(offered) == "tissueform.v1") return true;
    }
  }
  return false;
}

}  // namespace

GatewayRoutes::GatewayRoutes(AccessRules rules, ForwardedAddresses addresses, WebFiles files,
                             const LoginConfig& login, std::string page_config, UpstreamPool* pool,
                             GatewayCounters* counters)
    : rules_(std::move(rules)),
      addresses_(std::move(addresses)),
      files_(std::move(files)),
      page_config_(std::make_shared<const std::string>(std::move(page_config))),
      security_policy_(SecurityPolicy(login)),
      pool_(pool),
      counters_(counters) {}

HttpFields GatewayRoutes::CommonFields() const {
  return {{"server", "tissueform"},
          {"content-security-policy", security_policy_},
          {"x-content-type-options", "nosniff"},
          {"x-frame-options", "DENY"},
          {"referrer-policy", "no-referrer"},
          {"cross-origin-opener-policy", "same-origin"},
          {"cross-origin-resource-policy", "same-origin"}};
}

HttpReply GatewayRoutes::ReplyWith(int status) {
  HttpReply reply = {.status = status, .fields = CommonFields()};
  reply.fields.emplace_back("content-type", "text/plain; charset=utf-8");
  reply.fields.emplace_back("cache-control", "no-store");
  const auto* const sentence = std::find_if(kSentences.begin(), kSentences.end(),
                                            [&](const auto& s) { return s.first == status; });
  if (sentence != kSentences.end()) {
    reply.body = std::make_shared<const std::string>(sentence->second);
  }
  return reply;
}

HttpDecision GatewayRoutes::Refuse(GatewayEvent event, int status) {
  counters_->Add(event);
  return {.kind = HttpDecision::kReply, .reply = ReplyWith(status)};
}

HttpDecision GatewayRoutes::Decide(const HttpHead& head) {
  const absl::string_view path = head.Path();
  if (!rules_.AllowsHost(head)) return Refuse(GatewayEvent::kWrongHost, 421);
  if (!rules_.AllowsOrigin(head)) return Refuse(GatewayEvent::kWrongOrigin, 403);
  if (path == "/healthz" || path == "/readyz") {
    if (!IsReading(head)) return Refuse(GatewayEvent::kWrongMethod, 405);
    const bool fine = path == "/healthz" || pool_->IsReady();
    return {.kind = HttpDecision::kReply, .reply = ReplyWith(fine ? 200 : 503)};
  }
  if (path == "/call") return DecideSocket(head);
  if (path == "/config.json") return DecideConfig(head);
  if (head.method == "OPTIONS") return Preflight(head);
  if (head.method == "POST") return DecideCall(head);
  return DecideFile(head);
}

HttpDecision GatewayRoutes::DecideSocket(const HttpHead& head) {
  if (head.method != "GET") return Refuse(GatewayEvent::kWrongMethod, 405);
  if (!head.wants_socket || !OffersSubprotocol(head)) {
    return Refuse(GatewayEvent::kWrongSubprotocol, 426);
  }
  return {.kind = HttpDecision::kSocket};
}

HttpDecision GatewayRoutes::DecideCall(const HttpHead& head) {
  if (!IsServedMethod(head.Path())) return Refuse(GatewayEvent::kNoSuchPath, 404);
  if (!IsWebContentType(head.Field("content-type"))) {
    return Refuse(GatewayEvent::kWrongContentType, 415);
  }
  return {.kind = HttpDecision::kStream};
}

HttpDecision GatewayRoutes::DecideConfig(const HttpHead& head) {
  if (!IsReading(head)) return Refuse(GatewayEvent::kWrongMethod, 405);
  HttpReply reply = {.fields = CommonFields(), .body = page_config_};
  reply.fields.emplace_back("content-type", "application/json");
  reply.fields.emplace_back("cache-control", "no-store");
  return {.kind = HttpDecision::kReply, .reply = std::move(reply)};
}

HttpDecision GatewayRoutes::DecideFile(const HttpHead& head) {
  if (!IsReading(head)) return Refuse(GatewayEvent::kWrongMethod, 405);
  HttpReply file = files_.Reply(head.Path(), head.Field("if-none-match"));
  if (file.status == 404) return Refuse(GatewayEvent::kNoSuchPath, 404);
  HttpFields fields = CommonFields();
  fields.insert(fields.end(), file.fields.begin(), file.fields.end());
  file.fields = std::move(fields);
  return {.kind = HttpDecision::kReply, .reply = std::move(file)};
}

HttpDecision GatewayRoutes::Preflight(const HttpHead& head) {
  HttpReply reply = {.status = 204, .fields = CommonFields()};
  for (auto& field : OriginFields(head)) reply.fields.push_back(std::move(field));
  reply.fields.emplace_back("access-control-allow-methods", "POST");
  reply.fields.emplace_back("access-control-allow-headers", std::string(kRequestHeaders));
  reply.fields.emplace_back("access-control-max-age", "3600");
  return {.kind = HttpDecision::kReply, .reply = std::move(reply)};
}

HttpFields GatewayRoutes::OriginFields(const HttpHead& head) const {
  const absl::string_view origin = head.Field("origin");
  if (!rules_.IsForeignOrigin(origin)) return {};
  return {{"access-control-allow-origin", std::string(origin)}, {"vary", "origin"}};
}

std::shared_ptr<ReplySource> GatewayRoutes::Stream(const HttpHead& head, std::string body,
                                                   std::shared_ptr<ReplyStream> reply) {
  HttpFields fields = CommonFields();
  for (auto& field : OriginFields(head)) fields.push_back(std::move(field));
  fields.emplace_back("access-control-expose-headers", std::string(kExposedHeaders));
  auto call = std::make_shared<WebCall>(std::move(reply), std::move(fields), addresses_.Of(head));
  call->Begin(head, body, pool_, counters_);
  return call;
}

std::shared_ptr<SocketUser> GatewayRoutes::OpenSocket(std::shared_ptr<Socket> socket,
                                                      const HttpHead& head) {
  return std::make_shared<SocketCall>(std::move(socket), addresses_.Of(head), pool_, counters_);
}

}  // namespace tissueform
