// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_options.h"

#include <cstdint>
#include <limits>

#include "absl/strings/numbers.h"
#include "absl/strings/string_view.h"

#include "server/platform/program_options.h"

namespace tissueform {
namespace {

constexpr int64_t kMax = std::numeric_limits<int32_t>::max();
constexpr int64_t kKibibyte = 1 << 10;
constexpr int64_t kMebibyte = 1 << 20;
// A body and a message fit into an int of protobuf's.
constexpr int64_t kMaxMebibytes = 1024;
constexpr int64_t kMaxSeconds = 24 * 3600;

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
           "line and header fields of a request; more is answered with 431");
  AddLimit(app, "--max-message-mib", &limits->message_bytes, kMebibyte, kMaxMebibytes,
           "a message of a client; more is answered with 413, a WebSocket closed with 1009");
  AddLimit(app, "--max-answer-mib", &limits->answer_bytes, kMebibyte, kMaxMebibytes,
           "a message of a server; more ends the call with RESOURCE_EXHAUSTED");
  AddLimit(app, "--max-connections", &limits->connections, 1, kMax,
           "connections open at the same time, and no more than the descriptors that the process "
           "may open; others are closed at once");
  AddLimit(app, "--max-connections-per-address", &limits->connections_per_address, 1, kMax,
           "of these from one address (IPv6: one network of 64 bits); a proxy in front is one");
  AddLimit(app, "--max-sockets", &limits->sockets, 1, kMax,
           "of these that are WebSockets; others are answered with 503");
  AddLimit(app, "--calls-per-channel", &limits->calls_per_channel, 1, kMax,
           "calls at the same time on one connection to a server, fewer than it takes (128)");
  AddLimit(app, "--channels-per-server", &limits->channels_per_server, 1, 1024,
           "connections to each server; a call that finds no room on them is refused with "
           "RESOURCE_EXHAUSTED");
  AddSeconds(app, "--header-seconds", &limits->header_deadline,
             "for a request's header, from its first byte");
  AddSeconds(app, "--body-seconds", &limits->body_deadline, "for a request's body or a message");
  AddSeconds(app, "--start-seconds", &limits->start_deadline,
             "for the start of a call on a new WebSocket");
  AddSeconds(app, "--idle-seconds", &limits->idle_deadline,
             "how long a connection may ask for nothing (WebSockets: see --stall-seconds)");
  AddSeconds(app, "--stall-seconds", &limits->stall_deadline,
             "how long a client may take nothing of what waits for it, or answer no ping, and a "
             "server take nothing of a client");
  AddSeconds(app, "--drain-seconds", &limits->drain_deadline,
             "after SIGTERM or SIGINT, how long clients may take to read their last frames");
}

void AddLogin(CLI::App& app, LoginConfig* login) {
  app.add_option("--oidc-issuer", login->issuer,
                 "identity provider by which the planner logs its users in; without it there is no "
                 "login")
      ->type_name("URL");
  app.add_option("--oidc-client-id", login->client_id,
                 "the planner's name at the provider: a public client with PKCE")
      ->type_name("ID");
  app.add_option("--oidc-audience", login->audience,
                 "for whom tokens are asked for: the server's --token-audience")
      ->type_name("AUDIENCE");
  app.add_option("--oidc-scope", login->scopes, "scopes that are asked for, in one argument")
      ->capture_default_str()
      ->type_name("SCOPES");
}

void AddUpstreamOptions(CLI::App& app, GatewayOptions* options) {
  CLI::Option* ca = app.add_option("--server-ca", options->upstream.roots,
                                   "authorities in PEM of the servers' certificates: calls to them "
                                   "are encrypted. Renewed by rewriting the file")
                        ->type_name("FILE");
  CLI::Option* certificate =
      app.add_option("--cert", options->upstream.certificate,
                     "the gateway's own certificate, for servers that ask for one")
          ->type_name("FILE")
          ->needs(ca);
  CLI::Option* key = app.add_option("--key", options->upstream.key, "its key")
                         ->type_name("FILE")
                         ->needs(certificate);
  certificate->needs(key);
  app.add_flag("--insecure", options->insecure,
               "without --server-ca also to servers on other machines");
  app.add_option("--trust-forwarded-from", options->trusted_proxies,
                 "address of a proxy before the gateway whose X-Forwarded-For counts")
      ->type_name("ADDRESS");
}

// "HOST:PORT", IPv6 in brackets.
std::string SetListen(const std::string& text, GatewayOptions* options) {
  const size_t colon = text.rfind(':');
  absl::string_view host = absl::string_view(text).substr(0, colon);
  int port = -1;
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  const bool fine = colon != std::string::npos && !host.empty() &&
                    (bracketed || host.find(':') == absl::string_view::npos) &&
                    absl::SimpleAtoi(text.substr(colon + 1), &port) && port >= 0 && port <= 65535;
  if (!fine) return "HOST:PORT is needed, port 0 for a free one, IPv6 in brackets";
  options->host = std::string(bracketed ? host.substr(1, host.size() - 2) : host);
  options->port = port;
  return {};
}

}  // namespace

void AddGatewayOptions(CLI::App& app, GatewayOptions* options) {
  app.add_option(
         "--server", options->servers,
         "address of a tissueform-server, HOST:PORT or unix:/PATH; several may be named, in "
         "a cluster with their --node-name before it")
      ->required()
      ->type_name("[NODE=]ADDRESS");
  app.add_option_function<std::string>(
         "--listen",
         [options](const std::string& text) {
           const std::string error = SetListen(text, options);
           if (!error.empty()) throw CLI::ValidationError("--listen", error);
         },
         "address and port to listen on; port 0 takes a free one. Anything but loopback is open to "
         "the network: there is no login and no TLS here")
      ->default_str("127.0.0.1:8080")
      ->type_name("HOST:PORT");
  AddUpstreamOptions(app, options);
  app.add_option("--web", options->web, "folder of the built planner; without it none is served")
      ->type_name("DIR");
  app.add_option("--allow-host", options->allowed_hosts,
                 "name by which browsers reach the gateway, beside the address that it listens on "
                 "and those of loopback")
      ->type_name("HOST");
  app.add_option("--allow-origin", options->allowed_origins,
                 "origin of pages that may ask it, beside its own: https://planner.example.org")
      ->type_name("ORIGIN");
  app.add_option("--threads", options->threads, "threads that read and write")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  AddLogin(app, &options->login);
  AddLimits(app, &options->limits);
  app.add_option("--log-level", options->log_level,
                 "what is logged on stderr, without names, paths or content")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  app.add_option("--log-format", options->log_format,
                 "how lines of the log look: for people, or one JSON object each")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  app.add_option(
         "--metrics-port", options->metrics_port,
         "port of 127.0.0.1 on which Prometheus finds /metrics; 0 takes a free one (default: "
         "there is none)")
      ->check(CLI::Range(0, 65535));
  AddConfiguration(app, "TISSUEFORM_GATEWAY_");  // last: it looks at all options
}

}  // namespace tissueform
