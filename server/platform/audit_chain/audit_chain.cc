// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit_chain/audit_chain.h"

#include <algorithm>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "nlohmann/json.hpp"

namespace tissueform {
namespace {

constexpr absl::string_view kBeforeNumber = "{\"n\":";
constexpr absl::string_view kBeforeMac = ",\"mac\":\"";
constexpr absl::string_view kEnd = "\"}";
constexpr size_t kMacDigits = 64;
constexpr absl::string_view kCheckpoint = "tissueform-audit checkpoint n=";

bool IsMac(absl::string_view text) {
  return text.size() == kMacDigits && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

// Digits as we write them, up to the first other character.
std::optional<uint64_t> TakeNumber(absl::string_view* text) {
  const size_t size = std::min(text->find_first_not_of("0123456789"), text->size());
  uint64_t number = 0;
  if (!absl::SimpleAtoi(text->substr(0, size), &number)) return std::nullopt;
  text->remove_prefix(size);
  return number;
}

}  // namespace

std::optional<AuditLine> ParseAuditLine(absl::string_view line) {
  const size_t tail = kBeforeMac.size() + kMacDigits + kEnd.size();
  if (line.size() > kMaxAuditLineBytes || line.size() < kBeforeNumber.size() + tail) {
    return std::nullopt;
  }
  AuditLine parsed;
  parsed.body = line.substr(0, line.size() - tail);
  absl::string_view rest = line.substr(parsed.body.size());
  parsed.mac = rest.substr(kBeforeMac.size(), kMacDigits);
  absl::string_view number = parsed.body;
  if (!absl::StartsWith(rest, kBeforeMac) || !absl::EndsWith(rest, kEnd) || !IsMac(parsed.mac) ||
      !absl::ConsumePrefix(&number, kBeforeNumber)) {
    return std::nullopt;
  }
  const std::optional<uint64_t> n = TakeNumber(&number);
  if (!n.has_value() || !absl::StartsWith(number, ",\"")) return std::nullopt;
  parsed.number = *n;
  return parsed;
}

bool IsSealed(const AuditLine& line, absl::string_view previous_mac, const AuditKey& key) {
  return key.Mac({previous_mac, line.body}) == line.mac;
}

std::optional<AuditFileHead> ParseAuditFileHead(const AuditLine& line) {
  const auto object =
      nlohmann::json::parse(absl::StrCat(line.body, "}"), nullptr, /*allow_exceptions=*/false);
  if (!object.is_object() || object.value("event", nlohmann::json()) != "begin") {
    return std::nullopt;
  }
  const auto file = object.find("file");
  const auto key_id = object.find("key");
  const auto previous = object.find("previous");
  if (file == object.end() || !file->is_number_unsigned() || key_id == object.end() ||
      !key_id->is_string() || previous == object.end() || !previous->is_string()) {
    return std::nullopt;
  }
  return AuditFileHead{.file = file->get<uint64_t>(),
                       .key_id = key_id->get<std::string>(),
                       .previous = previous->get<std::string>()};
}

AuditChain::AuditChain(AuditKey key, AuditPosition position)
    : key_(std::move(key)), position_(std::move(position)) {}

std::string AuditChain::Seal(absl::string_view members) {
  const std::string body = absl::StrCat(kBeforeNumber, ++position_.number, ",", members);
  position_.mac = key_.Mac({position_.mac, body});
  return absl::StrCat(body, kBeforeMac, position_.mac, kEnd, "\n");
}

std::string AuditChain::SealHead(absl::string_view members) {
  return Seal(absl::StrCat("\"event\":\"begin\",\"file\":", ++position_.file, ",\"key\":\"",
                           key_.Id(), "\",\"previous\":\"", position_.mac, "\"",
                           members.empty() ? "" : ",", members));
}

std::string CheckpointText(const AuditPosition& position) {
  return absl::StrCat(kCheckpoint, position.number, " mac=", position.mac);
}

std::optional<AuditCheckpoint> ParseCheckpoint(absl::string_view line) {
  const size_t start = line.find(kCheckpoint);
  if (start == absl::string_view::npos) return std::nullopt;
  absl::string_view rest = line.substr(start + kCheckpoint.size());
  const std::optional<uint64_t> number = TakeNumber(&rest);
  if (!number.has_value() || !absl::ConsumePrefix(&rest, " mac=")) return std::nullopt;
  const absl::string_view mac = rest.substr(0, kMacDigits);
  if (!IsMac(mac)) return std::nullopt;
  return AuditCheckpoint{.number = *number, .mac = std::string(mac)};
}

}  // namespace tissueform
