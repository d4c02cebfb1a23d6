// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/access/auth/authenticator.h"

namespace tissueform {

// Tokens that are good no longer although they have not expired. Constant.
class RevocationList {
 public:
  static constexpr size_t kMaxBytes = size_t{8} << 20;

  // Of a JSON object with any of
  //   "token_digests": ["64 hexadecimal digits", ...]      as `tissueform token show` prints them
  //   "token_ids": ["...", ...]                            the claim `jti`
  //   "principals": {"alice": "2026-11-23T12:00:00Z", ...} all of hers that were issued before
  // JSON, because a file that is read while it is written then says nothing, and not less.
  //
  // Errors: InvalidArgument, without the text's own words.
  static absl::StatusOr<std::shared_ptr<const RevocationList>> Parse(absl::string_view text);

  // A token that does not say when it was issued counts as issued before.
  bool Holds(const Authenticated& authenticated) const;
  size_t size() const { return digests_.size() + ids_.size() + principals_.size(); }

 private:
  absl::flat_hash_set<std::string> digests_;
  absl::flat_hash_set<std::string> ids_;
  absl::flat_hash_map<std::string, std::chrono::system_clock::time_point> principals_;
};

}  // namespace tissueform
