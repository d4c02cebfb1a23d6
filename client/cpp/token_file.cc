// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/token_file.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <ios>
#include <system_error>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kLookInterval{1};

// What RFC 6750 lets stand after "Bearer".
bool IsTokenLetter(unsigned char c) {
  return absl::ascii_isalnum(c) ||
         absl::string_view("-._~+/=").find(static_cast<char>(c)) != absl::string_view::npos;
}

absl::Status CheckOwnerOnly(const std::filesystem::path& path) {
  using std::filesystem::perms;
  std::error_code error;
  const perms modes = std::filesystem::status(path, error).permissions();
  if (error || (modes & (perms::group_all | perms::others_all)) == perms::none) {
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(
      absl::StrCat(path.string(), ": other users can read the token; chmod 600"));
}

}  // namespace

absl::StatusOr<std::shared_ptr<TokenFile>> TokenFile::Open(const std::string& path) {
  std::shared_ptr<TokenFile> file(new TokenFile(path));
  std::error_code error;
  TF_ASSIGN_OR_RETURN(std::string token, file->Read());
  MutexLock lock(file->mutex_);
  file->token_ = std::move(token);
  file->written_ = std::filesystem::last_write_time(path, error);
  return file;
}

absl::StatusOr<std::string> TokenFile::Read() const {
  TF_RETURN_IF_ERROR(CheckOwnerOnly(path_));
  std::ifstream file(path_, std::ios::binary);
  if (!file.is_open()) {
    return absl::NotFoundError(
        absl::StrCat(path_.string(), ": the token cannot be read; log in, or name another file"));
  }
  std::string text(kMaxTokenFileBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(file.gcount()));
  const absl::string_view token = absl::StripAsciiWhitespace(text);
  if (token.empty() || text.size() > kMaxTokenFileBytes ||
      !std::all_of(token.begin(), token.end(), IsTokenLetter)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path_.string(), ": has no token; it is one word of letters, digits and -._~+/="));
  }
  return std::string(token);
}

std::string TokenFile::Current() {
  std::error_code error;
  const auto written = std::filesystem::last_write_time(path_, error);
  MutexLock lock(mutex_);
  if (error || written == written_) return token_;
  // Half of one that is just being written is read again: the file is then newer still.
  if (absl::StatusOr<std::string> token = Read(); token.ok()) {
    token_ = *std::move(token);
    written_ = written;
  }
  return token_;
}

TokenRenewal::TokenRenewal(std::shared_ptr<TokenFile> file, std::string used,
                           std::function<void(const std::string& token)> on_renewed)
    : file_(std::move(file)),
      on_renewed_(std::move(on_renewed)),
      used_(std::move(used)),
      thread_([this] { Watch(); }) {}

TokenRenewal::~TokenRenewal() {
  {
    MutexLock lock(mutex_);
    ends_ = true;
    ending_.NotifyAll();
  }
  thread_.join();
}

void TokenRenewal::Watch() {
  while (true) {
    {
      MutexLock lock(mutex_);
      const auto until = std::chrono::steady_clock::now() + kLookInterval;
      while (!ends_ && ending_.WaitUntil(mutex_, until)) {
      }
      if (ends_) return;
    }
    std::string token = file_->Current();
    if (token == used_) continue;
    on_renewed_(token);
    used_ = std::move(token);
  }
}

}  // namespace tissueform
