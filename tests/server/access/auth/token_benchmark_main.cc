// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "client/cli/account/token_work.h"
#include "core/base/percentiles.h"
#include "core/base/stopwatch.h"
#include "server/access/auth/token_authenticator.h"

// What it costs to know a caller by a token that was not seen before (cold), and by one that was
// (warm), in one run and in turns. Prints the medians and their ratio.
//
//   tissueform-token-benchmark FOLDER      makes its keys in FOLDER, which must be new
namespace tissueform {
namespace {

constexpr int kTokens = 2000;
constexpr char kIssuer[] = "https://login.example";
constexpr char kAudience[] = "tissueform";

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "tissueform-token-benchmark: %s\n", status.ToString().c_str());
  return EXIT_FAILURE;
}

double MicrosecondsOf(TokenAuthenticator* authenticator, const std::string& bearer) {
  const Stopwatch stopwatch;
  const bool known = authenticator->Authenticate({.authorization = {bearer}}).ok();
  const double microseconds = stopwatch.Seconds() * 1e6;
  if (!known) std::abort();
  return microseconds;
}

absl::Status Measure(const char* algorithm, const std::string& folder, int rsa_bits) {
  absl::Status status = MakeKeyFiles(folder, rsa_bits);
  if (!status.ok()) return status;
  TokenOptions options{.issuer = kIssuer, .audiences = {kAudience}};
  options.keys_file = folder + "/jwks.json";
  const auto authenticator = TokenAuthenticator::Start(options);
  if (!authenticator.ok()) return authenticator.status();
  TokenWords words{.issuer = kIssuer, .audiences = {kAudience}, .subject = "alice"};
  words.roles = {"admin"};
  std::vector<double> cold;
  std::vector<double> warm;
  for (int i = 0; i < kTokens; ++i) {
    const auto token = MakeTokenWith(folder + "/private.pem", words);
    if (!token.ok()) return token.status();
    const std::string bearer = absl::StrCat("Bearer ", *token);
    cold.push_back(MicrosecondsOf(authenticator->get(), bearer));
    warm.push_back(MicrosecondsOf(authenticator->get(), bearer));
  }
  const double cold_us = Percentile(cold, 50);
  const double warm_us = Percentile(warm, 50);
  std::printf("%s cold %.1f us, warm %.2f us (p99 %.2f), ratio %.0f\n", algorithm, cold_us, warm_us,
              Percentile(warm, 99), cold_us / warm_us);
  return absl::OkStatus();
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: tissueform-token-benchmark FOLDER\n");
    return EXIT_FAILURE;
  }
  const std::string folder = argv[1];
  absl::Status status = tissueform::Measure("ES256", folder + "/ec", 0);
  if (status.ok()) status = tissueform::Measure("RS256", folder + "/rsa", 2048);
  return status.ok() ? EXIT_SUCCESS : tissueform::Fail(status);
}
