// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/jwks_fetcher.h"

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include <curl/curl.h>

#include "server/access/auth/key_set.h"

namespace tissueform {
namespace {

constexpr long kConnectSeconds = 5;
constexpr long kSeconds = 10;
constexpr long kOk = 200;
constexpr std::array<absl::string_view, 3> kLoopback = {"localhost", "127.0.0.1", "[::1]"};

struct EndUrl {
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};
struct EndHandle {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
};

std::string PartOf(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, 0) != CURLUE_OK) return {};
  std::string copy(text);
  curl_free(text);
  return copy;
}

// libcurl's callbacks.
size_t Append(const char* bytes, size_t /*one*/, size_t size, void* answer) {
  auto* text = static_cast<std::string*>(answer);
  if (text->size() + size > KeySet::kMaxBytes) return 0;  // ends the transfer
  text->append(bytes, size);
  return size;
}
int EndWhenStopping(void* stopping, curl_off_t /*of*/, curl_off_t /*down*/, curl_off_t /*to*/,
                    curl_off_t /*up*/) {
  return *static_cast<const std::atomic<bool>*>(stopping) ? 1 : 0;
}

void SetUp(CURL* handle, const std::string& url, const std::atomic<bool>& stopping,
           std::string* answer) {
  curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");  // as CheckJwksUrl allows
  curl_easy_setopt(handle, CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT, kConnectSeconds);
  curl_easy_setopt(handle, CURLOPT_TIMEOUT, kSeconds);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, &Append);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, answer);
  curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
  curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, &EndWhenStopping);
  curl_easy_setopt(handle, CURLOPT_XFERINFODATA, &stopping);
}

}  // namespace

absl::Status CheckJwksUrl(const std::string& url) {
  const std::unique_ptr<CURLU, EndUrl> parsed(curl_url());
  if (curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), 0) != CURLUE_OK) {
    return absl::InvalidArgumentError("it is not a URL; write https://HOST/PATH");
  }
  if (!PartOf(parsed.get(), CURLUPART_USER).empty() ||
      !PartOf(parsed.get(), CURLUPART_PASSWORD).empty()) {
    return absl::InvalidArgumentError("it contains a user or a password; remove it");
  }
  const std::string scheme = PartOf(parsed.get(), CURLUPART_SCHEME);
  const std::string host = PartOf(parsed.get(), CURLUPART_HOST);
  const bool here = std::find(kLoopback.begin(), kLoopback.end(), host) != kLoopback.end();
  if (scheme == "https" || (scheme == "http" && here)) return absl::OkStatus();
  return absl::InvalidArgumentError("it must use https");
}

absl::StatusOr<std::string> DownloadJwks(const std::string& url,
                                         const std::atomic<bool>& stopping) {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  const std::unique_ptr<CURL, EndHandle> handle(curl_easy_init());
  if (handle == nullptr) return absl::UnavailableError("libcurl does not start");
  std::string answer;
  SetUp(handle.get(), url, stopping, &answer);
  if (const CURLcode code = curl_easy_perform(handle.get()); code != CURLE_OK) {
    return absl::UnavailableError(
        absl::StrCat("it does not answer: ",
                     code == CURLE_WRITE_ERROR ? "more than 1 MiB" : curl_easy_strerror(code)));
  }
  long http = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &http);
  if (http == kOk) return answer;
  return absl::UnavailableError(absl::StrCat("HTTP status ", http, " instead of 200"));
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
