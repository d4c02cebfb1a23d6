// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"

#include "core/base/mutex.h"

namespace tissueform {

// The longest token that is read.
inline constexpr int64_t kMaxTokenFileBytes = 16 << 10;

// A file with a token, which a login may renew while the process runs. Thread-safe.
class TokenFile {
 public:
  // Errors: NotFound, FailedPrecondition (others than its owner may read it), InvalidArgument (no
  // token: empty, over kMaxTokenFileBytes, other letters than those of tokens), with the path and
  // nothing of the token.
  static absl::StatusOr<std::shared_ptr<TokenFile>> Open(const std::string& path);

  // The token in the file; the previous one while the file is invalid.
  std::string Current();

 private:
  explicit TokenFile(std::filesystem::path path) : path_(std::move(path)) {}

  absl::StatusOr<std::string> Read() const;

  const std::filesystem::path path_;

  Mutex mutex_;
  std::filesystem::file_time_type written_ ABSL_GUARDED_BY(mutex_);
  std::string token_ ABSL_GUARDED_BY(mutex_);
};

// Notifies a long call within a second that its file holds another token. `on_renewed` is called on
// a thread of its own, until it is destroyed.
class TokenRenewal {
 public:
  TokenRenewal(std::shared_ptr<TokenFile> file, std::string used,
               std::function<void(const std::string& token)> on_renewed);
  ~TokenRenewal();
  TokenRenewal(const TokenRenewal&) = delete;
  TokenRenewal& operator=(const TokenRenewal&) = delete;

 private:
  void Watch();

  const std::shared_ptr<TokenFile> file_;
  const std::function<void(const std::string& token)> on_renewed_;
  std::string used_;  // the thread's

  Mutex mutex_;
  ConditionVariable ending_;
  bool ends_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace tissueform
