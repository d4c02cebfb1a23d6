// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_options.h"

#include <cstdint>
#include <limits>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "server/platform/program_options.h"
#include "server/platform/tls_options.h"

namespace tissueform {
namespace {

constexpr int64_t kMax = std::numeric_limits<int32_t>::max();
constexpr int64_t kKibibyte = 1 << 10;
constexpr int64_t kMebibyte = 1 << 20;
// A body and a message fit into an int of protobuf's.
constexpr int64_t kMaxMebibytes = 1024;
constexpr int64_t kMaxSeconds = 24 * 3600;
constexpr int kMaxPort = 65535;

template <typename Target>
void AddLimit(CLI::App& app, const std::string& name, Target* target, int64_t unit, int64_t most,
              const std::string& help) {
  app.add_option_function<int64_t>(
         name,
         [target, unit](const int64_t& value) { *target = static_cast<Target>(value * unit); },
         help)
      ->check(CLI::Range(int64_t{1}, most))
      ->default_str(std::to_string(static_cast<int64_t>(*target) / unit))
      ->type_name("INT");
}

void AddSeconds(CLI::App& app, const std::string& name, std::chrono::seconds* target,
                const std::string& help) {
  app.add_option_function<int64_t>(
         name, [target](const int64_t& value) { *target = std::chrono::seconds(value); }, help)
      ->check(CLI::Range(int64_t{1}, kMaxSeconds))
      ->default_str(std::to_string(target->count()))
      ->type_name("INT");
}

void AddLimits(CLI::App& app, GatewayLimits* limits) {
  AddLimit(app, "--max-header-kib", &limits->header_bytes, kKibibyte, 1024,
           "size of a request's line and header; 431 above it");
  AddLimit(app, "--max-message-mib", &limits->message_bytes, kMebibyte, kMaxMebibytes,
           "size of a client's message; 413 above it, or 1009 on a WebSocket");
  AddLimit(app, "--max-answer-mib", &limits->answer_bytes, kMebibyte, kMaxMebibytes,
           "size of a server's message; RESOURCE_EXHAUSTED above it");
  AddLimit(app, "--max-connections", &limits->connections, 1, kMax,
           "open connections, at most the file descriptors of the process less 200; further ones "
           "are closed at once");
  AddLimit(app, "--max-connections-per-address", &limits->connections_per_address, 1, kMax,
           "open connections per address (IPv6: per /64 network); a proxy is one address");
  AddLimit(app, "--max-sockets", &limits->sockets, 1, kMax, "open WebSockets; 503 above it");
  AddLimit(app, "--calls-per-channel", &limits->calls_per_channel, 1, kMax,
           "calls on one connection to the server, which takes 128 (HAProxy: 100)");
  AddLimit(app, "--channels-per-server", &limits->channels_per_server, 1, kMax,
           "connections to the server; without a free one a call is refused with "
           "RESOURCE_EXHAUSTED");
  AddSeconds(app, "--header-seconds", &limits->header_deadline,
             "time for a request's header, from its first byte");
  AddSeconds(app, "--body-seconds", &limits->body_deadline,
             "time for a request's body or a message");
  AddSeconds(app, "--start-seconds", &limits->start_deadline,
             "time for the start of a call on a new WebSocket");
  AddSeconds(app, "--idle-seconds", &limits->idle_deadline,
             "time that a connection may be idle (WebSockets: see --stall-seconds)");
  AddSeconds(app, "--stall-seconds", &limits->stall_deadline,
             "time that a client may read nothing or answer no ping, and that a "
             "server may read nothing");
  AddSeconds(app, "--drain-seconds", &limits->drain_deadline,
             "seconds after SIGTERM or SIGINT for clients to read their last frames");
}

void AddLogin(CLI::App& app, LoginConfig* login) {
  app.add_option("--oidc-issuer", login->issuer,
                 "identity provider of the planner's users; without it there is no "
                 "login")
      ->type_name("URL");
  app.add_option("--oidc-client-id", login->client_id,
                 "the planner's client id at the provider: a public client with PKCE")
      ->type_name("ID");
  app.add_option("--oidc-audience", login->audience,
                 "requested audience of tokens: the server's --token-audience")
      ->type_name("AUDIENCE");
  app.add_option("--oidc-scope", login->scopes, "requested scopes, in one argument")
      ->capture_default_str()
      ->type_name("SCOPES");
}

void AddUpstreamOptions(CLI::App& app, GatewayOptions* options) {
  CLI::Option* const ca = AddPemOption(app, {"--server-ca",
                                             "authorities of the server's certificate, in PEM; "
                                             "enables encryption. Rewrite the file to renew it",
                                             &options->upstream.authorities});
  AddIdentityOptions(app,
                     {"--cert", "the gateway's certificate, if the server requests one",
                      &options->upstream.certificate},
                     {"--key", "key of the gateway's certificate", &options->upstream.key})
      ->needs(ca);
  app.add_flag("--insecure", options->insecure,
               "allow unencrypted calls to a server on another machine");
  app.add_option("--trust-forwarded-from", options->trusted_proxies,
                 "address of a proxy whose X-Forwarded-For is trusted")
      ->type_name("ADDRESS");
}

// "unix:/PATH", or "HOST:PORT" with a host that has no "=" and, as a URL would, no "/".
bool IsAddress(absl::string_view text) {
  if (absl::StartsWith(text, "unix:")) return true;
  const size_t colon = text.rfind(':');
  int port = 0;
  return colon != absl::string_view::npos && colon > 0 &&
         text.find_first_of("=/") == absl::string_view::npos &&
         absl::SimpleAtoi(text.substr(colon + 1), &port) && port > 0 && port <= kMaxPort;
}

// Up to version 0.2 the gateway chose among several servers: NODE=ADDRESS...
std::string SetServer(const std::vector<std::string>& addresses, GatewayOptions* options) {
  constexpr absl::string_view kOneAddress =
      "the gateway takes one address; put HAProxy before the servers and give its address "
      "(docs/gateway.md, \"Several servers\")";
  if (addresses.size() != 1) return absl::StrCat(addresses.size(), " addresses: ", kOneAddress);
  const std::string& address = addresses.front();
  if (!IsAddress(address)) {
    const bool names_node = absl::StrContains(address, '=');
    return absl::StrCat(address, names_node ? " names a node: " : " is not an address: ",
                        names_node ? kOneAddress : "give HOST:PORT without http://, or unix:/PATH");
  }
  options->server = address;
  return {};
}

// "HOST:PORT", IPv6 in brackets.
std::string SetListen(const std::string& text, GatewayOptions* options) {
  const size_t colon = text.rfind(':');
  absl::string_view host = absl::string_view(text).substr(0, colon);
  int port = -1;
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  const bool fine = colon != std::string::npos && !host.empty() &&
                    (bracketed || host.find(':') == absl::string_view::npos) &&
                    absl::SimpleAtoi(text.substr(colon + 1), &port) && port >= 0 &&
                    port <= kMaxPort;
  if (!fine) return "HOST:PORT required, port 0 for a free one, IPv6 in brackets";
  options->host = std::string(bracketed ? host.substr(1, host.size() - 2) : host);
  options->port = port;
  return {};
}

}  // namespace

void AddGatewayOptions(CLI::App& app, GatewayOptions* options) {
  app.add_option_function<std::vector<std::string>>(
         "--server",
         [options](const std::vector<std::string>& addresses) {
           const std::string error = SetServer(addresses, options);
           if (!error.empty()) throw CLI::ValidationError("--server", error);
         },
         "address of the tissueform-server, or of the HAProxy before several: HOST:PORT or "
         "unix:/PATH")
      ->required()
      ->type_name("ADDRESS");
  app.add_option_function<std::string>(
         "--listen",
         [options](const std::string& text) {
           const std::string error = SetListen(text, options);
           if (!error.empty()) throw CLI::ValidationError("--listen", error);
         },
         "address and port to listen on; port 0 takes a free one. Other addresses than loopback "
         "are open to "
         "the network, without TLS")
      ->default_str("127.0.0.1:8080")
      ->type_name("HOST:PORT");
  AddUpstreamOptions(app, options);
  app.add_option("--web", options->web, "folder of the built planner (default: none)")
      ->type_name("DIR");
  app.add_option("--deviations", options->deviations,
                 "JSON file of what surgery and model err by, for the planner's 95 % intervals "
                 "(default: published figures; docs/accuracy.md, \"The whole band\")")
      ->type_name("FILE");
  app.add_option("--allow-host", options->allowed_hosts,
                 "host name of the gateway in browsers, in addition to its own address "
                 "and loopback")
      ->type_name("HOST");
  app.add_option("--allow-origin", options->allowed_origins,
                 "allowed origin of other pages: https://planner.example.org")
      ->type_name("ORIGIN");
  app.add_option("--threads", options->threads, "I/O threads")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  AddLogin(app, &options->login);
  AddLimits(app, &options->limits);
  app.add_option("--log-level", options->log_level,
                 "log level on stderr; names, paths and content are never logged")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  app.add_option("--log-format", options->log_format,
                 "log format: text, or one JSON object per line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  app.add_option("--metrics-port", options->metrics_port,
                 "port of 127.0.0.1 for Prometheus' /metrics; 0 takes a free one (default: "
                 "none)")
      ->check(CLI::Range(0, kMaxPort));
  AddConfiguration(app, "TISSUEFORM_GATEWAY_");  // last: it looks at all options
}

}  // namespace tissueform
