// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_authenticator.h"

#include <atomic>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "server/access/auth/token_text.h"

namespace tissueform {
namespace {

constexpr char kKeysOption[] = "--token-keys";
constexpr char kUrlOption[] = "--token-jwks-url";
constexpr char kRevocationsOption[] = "--token-revocations";
constexpr std::chrono::seconds kBetweenLines{1};

void LogAlarm(const absl::Status& taken) {
  if (taken.ok()) return;
  spdlog::error("{}; the previous values stay in use", std::string(taken.message()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<TokenAuthenticator>> TokenAuthenticator::Start(
    const TokenOptions& options, Now now) {
  TF_RETURN_IF_ERROR(CheckTokenOptions(options));
  std::unique_ptr<TokenAuthenticator> authenticator(
      new TokenAuthenticator(options, std::move(now)));
  TF_RETURN_IF_ERROR(authenticator->ReadAll());
  return authenticator;
}

TokenAuthenticator::TokenAuthenticator(const TokenOptions& options, Now now)
    : options_(options),
      rules_({.issuer = options.issuer, .audiences = options.audiences, .leeway = options.leeway}),
      now_(std::move(now)),
      files_(options.file_period) {}

absl::Status TokenAuthenticator::ReadAll() {
  if (!options_.revocations_file.empty()) {
    TF_RETURN_IF_ERROR(trust_.TakeRevocations(
        kRevocationsOption, ReadBoundedFile(options_.revocations_file, RevocationList::kMaxBytes)));
    files_.Add(options_.revocations_file, RevocationList::kMaxBytes, [this](const auto& content) {
      LogAlarm(trust_.TakeRevocations(kRevocationsOption, content));
    });
  }
  if (!options_.keys_file.empty()) {
    TF_RETURN_IF_ERROR(
        trust_.TakeKeys(kKeysOption, ReadBoundedFile(options_.keys_file, KeySet::kMaxBytes)));
    files_.Add(options_.keys_file, KeySet::kMaxBytes,
               [this](const auto& content) { TakeKeys(kKeysOption, content); });
  } else {
    const std::atomic<bool> stopping = false;
    const absl::Status asked =
        trust_.TakeKeys(kUrlOption, DownloadJwks(options_.jwks_url, stopping));
    if (absl::IsInvalidArgument(asked)) return asked;
    LogAlarm(asked);
    fetcher_ = std::make_unique<JwksFetcher>(
        options_.jwks_url, options_.jwks_times, asked.ok(),
        [this](const auto& answer) { return TakeKeys(kUrlOption, answer); });
  }
  files_.Start();
  return absl::OkStatus();
}

bool TokenAuthenticator::TakeKeys(const char* option, const absl::StatusOr<std::string>& content) {
  const std::shared_ptr<const KeySet> before = trust_.keys();
  const absl::Status taken = trust_.TakeKeys(option, content);
  if (trust_.keys() != before) cache_.Clear();
  LogAlarm(taken);
  return taken.ok();
}

absl::StatusOr<Authenticated> TokenAuthenticator::Authenticate(const Credentials& credentials) {
  absl::StatusOr<Authenticated> known = Identify(credentials);
  if (!known.ok()) RecordRefusal(known.status());
  return known;
}

void TokenAuthenticator::RecordRefusal(const absl::Status& refusal) {
  failures_.Count(refusal);
  MutexLock lock(log_mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now < next_line_) {
    ++unlogged_;
    return;
  }
  next_line_ = now + kBetweenLines;
  spdlog::info("refused a caller: {}; {} others since the last line of this kind",
               std::string(refusal.message()), std::exchange(unlogged_, 0));
}

absl::StatusOr<Authenticated> TokenAuthenticator::Identify(const Credentials& credentials) {
  TF_ASSIGN_OR_RETURN(const absl::string_view token, BearerToken(credentials.authorization));
  const std::string digest = Sha256Bytes(token);
  std::optional<Authenticated> known = cache_.Find(digest);
  if (!known.has_value()) {
    const int64_t generation = cache_.generation();  // before the keys
    TF_ASSIGN_OR_RETURN(known, Verify(token));
    cache_.Insert(digest, *known, generation);
  }
  TF_RETURN_IF_ERROR(Check(*known));
  return *std::move(known);
}

absl::StatusOr<Authenticated> TokenAuthenticator::Verify(absl::string_view token) {
  TF_ASSIGN_OR_RETURN(const TokenParts parts, SplitToken(token));
  TF_ASSIGN_OR_RETURN(const TokenHeader header, ReadTokenHeader(parts.header));
  const VerificationKey::Pointer key = trust_.keys()->Find(header.kid, header.algorithm);
  if (key == nullptr) {
    if (fetcher_ != nullptr) fetcher_->Ask();
    return RefuseToken(
        TokenFailure::kUnknownKey,
        absl::StrCat("the token's key does not belong to ", QuoteForCaller(options_.issuer),
                     ", whose tokens this server accepts"));
  }
  if (key->algorithm() != header.algorithm) return RefuseToken(TokenFailure::kAlgorithm);
  if (!key->Verifies(parts.signed_text, parts.signature)) {
    return RefuseToken(TokenFailure::kSignature);
  }
  TF_ASSIGN_OR_RETURN(TokenClaims claims, ReadTokenClaims(parts.claims, rules_, now_()));
  Authenticated authenticated{.principal = std::make_shared<Principal>(std::move(claims.principal)),
                              .expires = claims.expires,
                              .token_id = TokenDigest(parts.signed_text),
                              .token_name = std::move(claims.id)};
  if (claims.issued.has_value()) authenticated.issued = *claims.issued;
  return authenticated;
}

absl::Status TokenAuthenticator::Check(const Authenticated& authenticated) const {
  const auto now = now_();
  if (authenticated.expires + rules_.leeway <= now)
    return RefuseExpired(authenticated.expires, now);
  if (trust_.revocations()->Holds(authenticated)) return RefuseToken(TokenFailure::kRevoked);
  return absl::OkStatus();
}

absl::Status TokenAuthenticator::IsStillAuthorized(const Authenticated& authenticated) {
  absl::Status good = Check(authenticated);
  if (!good.ok()) RecordRefusal(good);
  return good;
}

}  // namespace tissueform
