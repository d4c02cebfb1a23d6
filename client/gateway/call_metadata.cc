// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/call_metadata.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace tissueform {
namespace {

// A server takes 8 KiB, with what gRPC says itself.
constexpr size_t kMaxMetadataBytes = 4096;
constexpr std::array<absl::string_view, 4> kSentNames = {"authorization", "x-tissueform-session",
                                                         "x-tissueform-node", "traceparent"};

bool IsText(absl::string_view value) {
  return std::all_of(value.begin(), value.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

}  // namespace

bool MayBeSent(absl::string_view name) {
  return std::find(kSentNames.begin(), kSentNames.end(), name) != kSentNames.end();
}

bool IsServedMethod(absl::string_view method) {
  if (method == "/grpc.health.v1.Health/Check") return true;
  if (method.size() > 256 || !absl::ConsumePrefix(&method, "/tissueform.v1.")) return false;
  const auto letter = [](char c) { return absl::ascii_isalnum(static_cast<unsigned char>(c)); };
  const size_t slash = method.find('/');
  if (slash == absl::string_view::npos) return false;
  const absl::string_view service = method.substr(0, slash);
  const absl::string_view name = method.substr(slash + 1);
  return !service.empty() && !name.empty() && std::all_of(service.begin(), service.end(), letter) &&
         std::all_of(name.begin(), name.end(), letter);
}

absl::Status CheckMetadata(const std::map<std::string, std::string>& metadata) {
  size_t bytes = 0;
  for (const auto& [name, value] : metadata) {
    bytes += name.size() + value.size();
    if (!IsText(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("metadata ", name, ": only printable ASCII is allowed"));
    }
  }
  if (bytes > kMaxMetadataBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("metadata: ", bytes, " bytes are more than ", kMaxMetadataBytes));
  }
  return absl::OkStatus();
}

std::map<std::string, std::string> MetadataOf(const HttpHead& head) {
  std::map<std::string, std::string> metadata;
  for (const auto& [name, value] : head.fields) {
    if (MayBeSent(name)) metadata.emplace(name, value);
  }
  return metadata;
}

absl::StatusOr<std::chrono::nanoseconds> ParseGrpcTimeout(absl::string_view text) {
  using std::chrono::nanoseconds;
  static constexpr std::array<std::pair<char, int64_t>, 6> kUnits = {{{'H', 3'600'000'000'000},
                                                                      {'M', 60'000'000'000},
                                                                      {'S', 1'000'000'000},
                                                                      {'m', 1'000'000},
                                                                      {'u', 1'000},
                                                                      {'n', 1}}};
  // 300 years and more do not fit into nanoseconds.
  constexpr int64_t kLongest = int64_t{365} * 24 * 3'600'000'000'000;
  int64_t number = 0;
  const bool digits = text.size() >= 2 && text.size() <= 9 &&
                      std::all_of(text.begin(), text.end() - 1, absl::ascii_isdigit) &&
                      absl::SimpleAtoi(text.substr(0, text.size() - 1), &number);
  for (const auto& [unit, factor] : kUnits) {
    if (digits && text.back() == unit) {
      return nanoseconds(number > kLongest / factor ? kLongest : number * factor);
    }
  }
  return absl::InvalidArgumentError(
      "grpc-timeout must be at most eight digits and one of H, M, S, m, u and n");
}

std::map<std::string, std::string> AllowedMetadata(
    const std::multimap<grpc::string_ref, grpc::string_ref>& metadata) {
  std::map<std::string, std::string> forwarded;
  size_t bytes = 0;
  for (const auto& [key, data] : metadata) {
    const absl::string_view name(key.data(), key.size());
    const absl::string_view value(data.data(), data.size());
    bytes += name.size() + value.size();
    const bool allowed = absl::StartsWith(name, "x-tissueform-") || name == "traceparent";
    if (!allowed || absl::EndsWith(name, "-bin") || !IsText(value)) continue;
    if (bytes <= kMaxMetadataBytes) forwarded.emplace(name, value);
  }
  return forwarded;
}

}  // namespace tissueform
