// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "server/access/auth/authenticator.h"
#include "server/access/auth/file_watcher.h"
#include "server/access/auth/jwks_fetcher.h"
#include "server/access/auth/token_cache.h"
#include "server/access/auth/token_claims.h"
#include "server/access/auth/token_failure.h"
#include "server/access/auth/token_options.h"
#include "server/access/auth/token_trust.h"

namespace tissueform {

// Knows callers by the JSON Web Tokens of one issuer (docs/security.md): RS256 or ES256, by its
// keys alone. Authenticate never blocks: it refuses a token with an unknown key and starts a
// request to the URL for new keys, so that a moment later the key is known.
class TokenAuthenticator : public Authenticator {
 public:
  using Now = std::function<std::chrono::system_clock::time_point()>;

  // Reads keys and revocations, and watches them from then on. Blocks; a URL that does not answer
  // within 10 s is asked again later, and until then no token is accepted.
  //
  // Errors: InvalidArgument and Unavailable, in a line that names the option.
  static absl::StatusOr<std::unique_ptr<TokenAuthenticator>> Start(
      const TokenOptions& options, Now now = std::chrono::system_clock::now);

  // Errors: RefuseToken's.
  absl::StatusOr<Authenticated> Authenticate(const Credentials& credentials) override;
  // Until the leeway after its end, as for new calls.
  absl::Status IsStillAuthorized(const Authenticated& authenticated) override;

  // What was refused. Of streams, those that were ended count as well.
  const TokenFailures& failures() const { return failures_; }
  TokenStanding standing() const { return trust_.standing(); }

 private:
  TokenAuthenticator(const TokenOptions& options, Now now);

  // The first look, and the threads for all later ones.
  absl::Status ReadAll();
  bool TakeKeys(const char* option, const absl::StatusOr<std::string>& content);

  absl::StatusOr<Authenticated> Identify(const Credentials& credentials);
  absl::StatusOr<Authenticated> Verify(absl::string_view token);
  absl::Status Check(const Authenticated& authenticated) const;
  // Counts it, and logs one a second: who floods the server shall not flood its log.
  void RecordRefusal(const absl::Status& refusal) ABSL_LOCKS_EXCLUDED(log_mutex_);

  // Constant.
  const TokenOptions options_;
  const TokenRules rules_;
  const Now now_;

  // Self-synchronised.
  TokenTrust trust_;
  TokenCache cache_;
  TokenFailures failures_;
  Mutex log_mutex_;
  std::chrono::steady_clock::time_point next_line_ ABSL_GUARDED_BY(log_mutex_);
  int64_t unlogged_ ABSL_GUARDED_BY(log_mutex_) = 0;
  FileWatcher files_;
  std::unique_ptr<JwksFetcher> fetcher_;  // null: the keys are in a file; constant once it is there
};

}  // namespace tissueform
