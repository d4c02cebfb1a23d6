// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/access/auth/verification_key.h"

namespace tissueform {

// The keys whose tokens are taken, by their `kid`. Constant.
class KeySet {
 public:
  static constexpr size_t kMaxBytes = size_t{1} << 20;
  static constexpr int kMaxKeys = 100;

  // Of a text that is a JSON Web Key Set, or PEM public keys, whose `kid` is their thumbprint. Of a
  // set, what is not for verifying RS256 or ES256 is passed over.
  //
  // Errors: InvalidArgument, in a sentence without the text's own words: not of this form, a key
  // that is unusable (too short, no point, private), two of one name, none at all.
  static absl::StatusOr<std::shared_ptr<const KeySet>> Parse(absl::string_view text);

  // Null: none of this name. Without a name: the only one of the algorithm, null if there are
  // several.
  VerificationKey::Pointer Find(const std::optional<std::string>& kid,
                                TokenAlgorithm algorithm) const;
  int size() const { return static_cast<int>(keys_.size()); }

  // The same names with the same keys.
  bool SameAs(const KeySet& other) const;

 private:
  std::map<std::string, VerificationKey::Pointer> keys_;
};

}  // namespace tissueform
