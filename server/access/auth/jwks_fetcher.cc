// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/jwks_fetcher.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "server/access/auth/key_set.h"
#include "server/platform/http/http_client.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kConnectTime{5};
constexpr std::chrono::seconds kTotalTime{10};
constexpr int kOk = 200;

}  // namespace

absl::Status CheckJwksUrl(const std::string& url) {
  const std::optional<UrlFacts> facts = ReadUrl(url);
  if (!facts) return absl::InvalidArgumentError("it is not a URL; write https://HOST/PATH");
  if (facts->has_login) {
    return absl::InvalidArgumentError("it contains a user or a password; remove it");
  }
  if (facts->IsConfidential()) return absl::OkStatus();
  return absl::InvalidArgumentError("it must use https");
}

absl::StatusOr<std::string> DownloadJwks(const std::string& url,
                                         const std::atomic<bool>& stopping) {
  absl::StatusOr<HttpAnswer> answer = SendHttp({.url = url,
                                                .connect_time = kConnectTime,
                                                .total_time = kTotalTime,
                                                .max_body_bytes = KeySet::kMaxBytes,
                                                .stopping = &stopping});
  if (!answer.ok()) {
    const bool is_large = absl::IsOutOfRange(answer.status());
    return absl::UnavailableError(absl::StrCat(
        "it does not answer: ", is_large ? "more than 1 MiB" : answer.status().message()));
  }
  if (answer->status == kOk) return std::move(answer->body);
  return absl::UnavailableError(absl::StrCat("HTTP status ", answer->status, " instead of 200"));
}

JwksFetcher::JwksFetcher(std::string url, const JwksTimes& times, bool asked_well, Take take)
    : url_(std::move(url)),
      times_(times),
      take_(std::move(take)),
      last_(std::chrono::steady_clock::now()),
      next_(last_ + (asked_well ? times.refresh : times.retry)),
      thread_([this] { Run(); }) {}

JwksFetcher::~JwksFetcher() {
  stopping_ = true;
  {
    MutexLock lock(mutex_);
    changed_.NotifyAll();
  }
  thread_.join();
}

void JwksFetcher::Ask() {
  MutexLock lock(mutex_);
  if (std::exchange(asked_, true)) return;
  changed_.NotifyAll();
}

bool JwksFetcher::WaitUntilDue() {
  MutexLock lock(mutex_);
  while (!stopping_) {
    const TimePoint due = asked_ ? std::min(next_, last_ + times_.least) : next_;
    if (std::chrono::steady_clock::now() >= due) {
      asked_ = false;
      return true;
    }
    changed_.WaitUntil(mutex_, due);
  }
  return false;
}

void JwksFetcher::Run() {
  while (WaitUntilDue()) {
    const bool good = take_(DownloadJwks(url_, stopping_));
    MutexLock lock(mutex_);
    last_ = std::chrono::steady_clock::now();
    next_ = last_ + (good ? times_.refresh : times_.retry);
  }
}

}  // namespace tissueform
