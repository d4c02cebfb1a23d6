// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/device_login.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using std::chrono::seconds;

constexpr char kDeviceGrant[] = "urn:ietf:params:oauth:grant-type:device_code";
constexpr size_t kMaxLoginTokenBytes = size_t{16} << 10;
constexpr size_t kMaxUserCodeBytes = 64;
constexpr size_t kMaxIssuerBytes = 200;
constexpr int64_t kMaxSeconds = 24 * 3600;
// RFC 8628, 3.2 and 3.5.
constexpr seconds kInterval{5};
constexpr seconds kCodeLifetime{600};

absl::Status NoAnswer(absl::string_view what) {
  return absl::DataLossError(
      absl::StrCat("the identity provider's answer ", what, "; check --issuer"));
}

std::string TextOf(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

seconds SecondsOf(const nlohmann::json& json, const char* key, seconds otherwise) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return otherwise;
  const double value = found->get<double>();
  return value > 0 && value < static_cast<double>(kMaxSeconds)
             ? seconds(static_cast<int64_t>(value))
             : otherwise;
}

bool IsGraphic(absl::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char letter) { return absl::ascii_isgraph(letter); });
}

// Why a provider that names itself `found` is not the one of --issuer. Bounded: it is the peer's.
absl::Status AnotherIssuer(const std::string& found, const std::string& expected) {
  if (found.empty() || found.size() > kMaxIssuerBytes || !IsGraphic(found)) {
    return NoAnswer("does not name an issuer");
  }
  if (absl::StrContains(found, '{')) {
    return absl::DataLossError(
        absl::StrCat("the identity provider's issuer is ", found,
                     ", shared by all tenants; pass your tenant's address with "
                     "--issuer, not ",
                     expected));
  }
  return absl::DataLossError(absl::StrCat("the identity provider's issuer is ", found,
                                          ", and --issuer says ", expected, "; give --issuer ",
                                          found));
}

absl::StatusOr<nlohmann::json> ObjectOf(const HttpAnswer& answer) {
  nlohmann::json json = nlohmann::json::parse(answer.body, nullptr, false);
  if (!json.is_object())
    return NoAnswer(absl::StrCat("(", answer.status, ") is not a JSON object"));
  return json;
}

// The provider's own word for what is wrong, where it is one.
std::string ErrorOf(const nlohmann::json& json) {
  const std::string error = TextOf(json, "error");
  const bool is_word = !error.empty() && error.size() <= 40 &&
                       std::all_of(error.begin(), error.end(), [](char letter) {
                         return absl::ascii_islower(letter) || letter == '_';
                       });
  return is_word ? error : "an unknown error";
}

absl::Status Refused(const std::string& error) {
  return absl::PermissionDeniedError(
      absl::StrCat("the identity provider refused the login: ", error, "; ask its administrator"));
}

absl::StatusOr<LoginTokens> TokensOf(const nlohmann::json& json) {
  LoginTokens tokens = {.access_token = TextOf(json, "access_token"),
                        .refresh_token = TextOf(json, "refresh_token"),
                        .lifetime = SecondsOf(json, "expires_in", seconds(0))};
  if (tokens.access_token.empty() || tokens.access_token.size() > kMaxLoginTokenBytes ||
      tokens.refresh_token.size() > kMaxLoginTokenBytes || !IsGraphic(tokens.access_token) ||
      !IsGraphic(tokens.refresh_token)) {
    return NoAnswer("has no token");
  }
  return tokens;
}

}  // namespace

struct DeviceLogin::Endpoints {
  std::string token;
  std::string device;
};

struct DeviceLogin::Begun {
  std::string device_code;
  DevicePrompt prompt;
  seconds interval;
};

DeviceLogin::DeviceLogin(LoginClient client, LoginExchange exchange, Wait wait)
    : client_(std::move(client)), exchange_(std::move(exchange)), wait_(std::move(wait)) {}

HttpForm DeviceLogin::Form() const {
  HttpForm form = {{"client_id", client_.client_id}};
  if (client_.audience.empty()) return form;
  form.emplace_back("audience", client_.audience);
  // RFC 8707's name for the same, which must be a URI.
  if (absl::StrContains(client_.audience, ':')) form.emplace_back("resource", client_.audience);
  return form;
}

absl::StatusOr<DeviceLogin::Endpoints> DeviceLogin::Discover() {
  TF_RETURN_IF_ERROR(CheckLoginUrl("--issuer", client_.issuer));
  const absl::string_view slash = absl::EndsWith(client_.issuer, "/") ? "" : "/";
  const LoginRequest request = {
      .url = absl::StrCat(client_.issuer, slash, ".well-known/openid-configuration")};
  TF_ASSIGN_OR_RETURN(const HttpAnswer answer, exchange_(request));
  if (answer.status != 200) return NoAnswer(absl::StrCat("is status ", answer.status));
  TF_ASSIGN_OR_RETURN(const nlohmann::json json, ObjectOf(answer));
  if (const std::string issuer = TextOf(json, "issuer"); issuer != client_.issuer) {
    return AnotherIssuer(issuer, client_.issuer);
  }
  Endpoints endpoints = {.token = TextOf(json, "token_endpoint"),
                         .device = TextOf(json, "device_authorization_endpoint")};
  TF_RETURN_IF_ERROR(CheckLoginUrl("the provider's token endpoint", endpoints.token));
  return endpoints;
}

absl::StatusOr<DeviceLogin::Begun> DeviceLogin::Begin(const std::string& endpoint) {
  if (endpoint.empty()) {
    return absl::FailedPreconditionError(
        "the identity provider has no device flow; use the planner, or a token file of its "
        "own");
  }
  TF_RETURN_IF_ERROR(CheckLoginUrl("the provider's device endpoint", endpoint));
  HttpForm form = Form();
  form.emplace_back("scope", client_.scopes);
  TF_ASSIGN_OR_RETURN(const HttpAnswer answer, exchange_({.url = endpoint, .form = form}));
  TF_ASSIGN_OR_RETURN(const nlohmann::json json, ObjectOf(answer));
  if (answer.status != 200) return Refused(ErrorOf(json));
  Begun begun = {.device_code = TextOf(json, "device_code"),
                 .prompt = {.url = TextOf(json, "verification_uri"),
                            .user_code = TextOf(json, "user_code"),
                            .complete_url = TextOf(json, "verification_uri_complete"),
                            .lifetime = SecondsOf(json, "expires_in", kCodeLifetime)},
                 .interval = SecondsOf(json, "interval", kInterval)};
  TF_RETURN_IF_ERROR(CheckLoginUrl("the provider's login URL", begun.prompt.url));
  if (!CheckLoginUrl("", begun.prompt.complete_url).ok()) begun.prompt.complete_url.clear();
  if (begun.device_code.empty() || begun.prompt.user_code.empty() ||
      begun.prompt.user_code.size() > kMaxUserCodeBytes || !IsGraphic(begun.prompt.user_code)) {
    return NoAnswer("has no code");
  }
  return begun;
}

absl::StatusOr<LoginTokens> DeviceLogin::Poll(const std::string& endpoint, const Begun& begun) {
  HttpForm form = Form();
  form.emplace_back("grant_type", kDeviceGrant);
  form.emplace_back("device_code", begun.device_code);
  seconds interval = begun.interval;
  for (seconds waited{0}; waited < begun.prompt.lifetime; waited += interval) {
    wait_(interval);
    const absl::StatusOr<HttpAnswer> answer = exchange_({.url = endpoint, .form = form});
    // The user may still be typing while the network is away.
    if (!answer.ok()) continue;
    TF_ASSIGN_OR_RETURN(const nlohmann::json json, ObjectOf(*answer));
    if (answer->status == 200) return TokensOf(json);
    const std::string error = ErrorOf(json);
    if (error == "slow_down") interval += kInterval;
    if (error == "expired_token") break;
    if (error != "slow_down" && error != "authorization_pending") return Refused(error);
  }
  return absl::DeadlineExceededError("the code was not entered in time; start again");
}

absl::StatusOr<LoginTokens> DeviceLogin::Run(
    const std::function<void(const DevicePrompt&)>& prompt) {
  TF_ASSIGN_OR_RETURN(const Endpoints endpoints, Discover());
  TF_ASSIGN_OR_RETURN(const Begun begun, Begin(endpoints.device));
  prompt(begun.prompt);
  return Poll(endpoints.token, begun);
}

absl::StatusOr<LoginTokens> DeviceLogin::Renew(const std::string& refresh_token) {
  TF_ASSIGN_OR_RETURN(const Endpoints endpoints, Discover());
  HttpForm form = Form();
  form.emplace_back("grant_type", "refresh_token");
  form.emplace_back("refresh_token", refresh_token);
  TF_ASSIGN_OR_RETURN(const HttpAnswer answer, exchange_({.url = endpoints.token, .form = form}));
  TF_ASSIGN_OR_RETURN(const nlohmann::json json, ObjectOf(answer));
  if (answer.status != 200) return Refused(ErrorOf(json));
  TF_ASSIGN_OR_RETURN(LoginTokens tokens, TokensOf(json));
  if (tokens.refresh_token.empty()) tokens.refresh_token = refresh_token;
  return tokens;
}

}  // namespace tissueform
