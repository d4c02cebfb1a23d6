// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/key_set.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "server/access/auth/token_text.h"

namespace tissueform {
namespace {

using KeyMap = std::map<std::string, VerificationKey::Pointer>;

// Empty where the member is missing or not a string.
std::string TextOf(const nlohmann::json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

absl::StatusOr<std::string> NumberBytes(const nlohmann::json& key, const char* name) {
  std::optional<std::string> bytes = DecodeBase64Url(TextOf(key, name));
  if (bytes.has_value() && !bytes->empty()) return *std::move(bytes);
  return absl::InvalidArgumentError(
      absl::StrCat("a key's \"", name, "\" is missing or not in base64url"));
}

bool IsForTokens(const nlohmann::json& key) {
  const std::string use = TextOf(key, "use");
  const std::string algorithm = TextOf(key, "alg");
  const std::string kind = TextOf(key, "kty");
  if (!use.empty() && use != "sig") return false;
  if (kind == "RSA") return algorithm.empty() || algorithm == "RS256";
  return kind == "EC" && TextOf(key, "crv") == "P-256" &&
         (algorithm.empty() || algorithm == "ES256");
}

absl::StatusOr<VerificationKey::Pointer> KeyOf(const nlohmann::json& key) {
  if (key.contains("d")) {
    return absl::InvalidArgumentError("it contains a private key; keep only the public key");
  }
  const bool rsa = TextOf(key, "kty") == "RSA";
  TF_ASSIGN_OR_RETURN(const std::string first, NumberBytes(key, rsa ? "n" : "x"));
  TF_ASSIGN_OR_RETURN(const std::string second, NumberBytes(key, rsa ? "e" : "y"));
  return rsa ? VerificationKey::FromRsa(first, second) : VerificationKey::FromP256(first, second);
}

absl::Status AddKey(std::string kid, VerificationKey::Pointer key, KeyMap* keys) {
  if (kid.empty()) kid = key->thumbprint();
  if (keys->emplace(std::move(kid), std::move(key)).second) return absl::OkStatus();
  return absl::InvalidArgumentError("two keys have the same `kid`");
}

absl::Status ReadJwks(absl::string_view text, KeyMap* keys) {
  const nlohmann::json set = nlohmann::json::parse(text.begin(), text.end(), nullptr, false);
  const auto listed = set.is_object() ? set.find("keys") : set.end();
  if (!set.is_object() || listed == set.end() || !listed->is_array()) {
    return absl::InvalidArgumentError("it is not a JSON Web Key Set: {\"keys\": [...]}");
  }
  if (listed->size() > KeySet::kMaxKeys) {
    return absl::InvalidArgumentError(
        absl::StrCat("there are more than ", KeySet::kMaxKeys, " keys"));
  }
  for (const nlohmann::json& key : *listed) {
    if (!key.is_object()) return absl::InvalidArgumentError("a key is not a JSON object");
    if (!IsForTokens(key)) continue;
    TF_ASSIGN_OR_RETURN(VerificationKey::Pointer verifier, KeyOf(key));
    TF_RETURN_IF_ERROR(AddKey(TextOf(key, "kid"), std::move(verifier), keys));
  }
  return absl::OkStatus();
}

absl::Status ReadPem(absl::string_view text, KeyMap* keys) {
  TF_ASSIGN_OR_RETURN(const std::vector<VerificationKey::Pointer> listed,
                      VerificationKey::FromPem(text));
  for (const VerificationKey::Pointer& key : listed) {
    TF_RETURN_IF_ERROR(AddKey({}, key, keys));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::shared_ptr<const KeySet>> KeySet::Parse(absl::string_view text) {
  if (text.size() > kMaxBytes) {
    return absl::InvalidArgumentError("it is larger than 1 MiB; keep only the signing keys");
  }
  auto set = std::make_shared<KeySet>();
  const bool json = absl::StartsWith(absl::StripLeadingAsciiWhitespace(text), "{");
  TF_RETURN_IF_ERROR(json ? ReadJwks(text, &set->keys_) : ReadPem(text, &set->keys_));
  if (!set->keys_.empty()) return set;
  return absl::InvalidArgumentError("it has no key for RS256 or ES256");
}

VerificationKey::Pointer KeySet::Find(const std::optional<std::string>& kid,
                                      TokenAlgorithm algorithm) const {
  if (kid.has_value()) {
    const auto found = keys_.find(*kid);
    return found == keys_.end() ? nullptr : found->second;
  }
  VerificationKey::Pointer only;
  for (const auto& [name, key] : keys_) {
    if (key->algorithm() != algorithm) continue;
    if (only != nullptr) return nullptr;
    only = key;
  }
  return only;
}

bool KeySet::SameAs(const KeySet& other) const {
  return std::equal(keys_.begin(), keys_.end(), other.keys_.begin(), other.keys_.end(),
                    [](const auto& a, const auto& b) {
                      return a.first == b.first && a.second->thumbprint() == b.second->thumbprint();
                    });
}

}  // namespace tissueform
