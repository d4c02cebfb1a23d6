// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/http/tls_stream.h"

#include <array>
#include <poll.h>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <sys/ioctl.h>

#include "core/base/status_macros.h"
#include "server/platform/http/curl_handle.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kPollMilliseconds = 100;
constexpr std::chrono::milliseconds kBetweenLooks{2};

std::string UrlOf(const TlsStream::Peer& peer) {
  const bool is_ipv6 = absl::StrContains(peer.host, ':');
  return absl::StrCat("https://", is_ipv6 ? "[" : "", peer.host, is_ipv6 ? "]" : "", ":",
                      peer.port);
}

// libcurl connects and shakes hands, and leaves the bytes to us.
void SetPeer(CURL* handle, const TlsStream::Peer& peer) {
  curl_easy_setopt(handle, CURLOPT_URL, UrlOf(peer).c_str());
  curl_easy_setopt(handle, CURLOPT_CONNECT_ONLY, 1L);
  curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_SSL_ENABLE_ALPN, 0L);  // not HTTP
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT, static_cast<long>(peer.connect_time.count()));
  curl_easy_setopt(handle, CURLOPT_TCP_KEEPALIVE, 1L);
  SetCurlTls(handle, peer.files.authorities, peer.files.certificate, peer.files.key);
}

}  // namespace

struct TlsStream::Connection {
  CurlHandle handle;
  curl_socket_t socket = CURL_SOCKET_BAD;
  const std::atomic<bool>* stopping = nullptr;

  absl::Status CheckPatience(SteadyClock::time_point deadline) const {
    if (stopping != nullptr && *stopping) return absl::CancelledError("the program ends");
    if (SteadyClock::now() < deadline) return absl::OkStatus();
    return absl::DeadlineExceededError("the peer does not read");
  }

  // Bytes that the peer's kernel has not acknowledged.
  absl::StatusOr<int> Unacknowledged() const {
    int count = 0;
    if (ioctl(socket, TIOCOUTQ, &count) != 0) return absl::UnavailableError("the socket is gone");
    return count;
  }
};

TlsStream::TlsStream(std::unique_ptr<Connection> connection) : connection_(std::move(connection)) {}
TlsStream::~TlsStream() = default;

absl::StatusOr<std::unique_ptr<TlsStream>> TlsStream::Connect(const Peer& peer) {
  auto connection = std::make_unique<Connection>();
  TF_ASSIGN_OR_RETURN(connection->handle, MakeCurlHandle(peer.stopping));
  CURL* const handle = connection->handle.get();
  connection->stopping = peer.stopping;
  SetPeer(handle, peer);
  std::array<char, CURL_ERROR_SIZE> words = {};
  curl_easy_setopt(handle, CURLOPT_ERRORBUFFER, words.data());
  const CURLcode code = curl_easy_perform(handle);
  curl_easy_setopt(handle, CURLOPT_ERRORBUFFER, nullptr);
  if (code != CURLE_OK) {
    const absl::Status error = CurlError(code);
    return words[0] == '\0' ? error : absl::Status(error.code(), words.data());
  }
  curl_easy_getinfo(handle, CURLINFO_ACTIVESOCKET, &connection->socket);
  return std::unique_ptr<TlsStream>(new TlsStream(std::move(connection)));
}

absl::Status TlsStream::Send(absl::string_view bytes, std::chrono::milliseconds patience) {
  SteadyClock::time_point deadline = SteadyClock::now() + patience;
  while (!bytes.empty()) {
    size_t sent = 0;
    const CURLcode code =
        curl_easy_send(connection_->handle.get(), bytes.data(), bytes.size(), &sent);
    if (code == CURLE_OK) {
      bytes.remove_prefix(sent);
      deadline = SteadyClock::now() + patience;
      continue;
    }
    if (code != CURLE_AGAIN) return CurlError(code);
    TF_RETURN_IF_ERROR(connection_->CheckPatience(deadline));
    pollfd ready = {.fd = connection_->socket, .events = POLLOUT, .revents = 0};
    poll(&ready, 1, kPollMilliseconds);
  }
  return WaitForAcknowledgment(patience);
}

absl::Status TlsStream::WaitForAcknowledgment(std::chrono::milliseconds patience) {
  SteadyClock::time_point deadline = SteadyClock::now() + patience;
  for (int before = 0;;) {
    TF_ASSIGN_OR_RETURN(const int unacknowledged, connection_->Unacknowledged());
    if (!IsOpen()) return absl::UnavailableError("the peer has closed the connection");
    if (unacknowledged == 0) return absl::OkStatus();
    if (unacknowledged != before) deadline = SteadyClock::now() + patience;
    before = unacknowledged;
    TF_RETURN_IF_ERROR(connection_->CheckPatience(deadline));
    std::this_thread::sleep_for(kBetweenLooks);
  }
}

bool TlsStream::IsOpen() {
  std::array<char, 1024> ignored = {};
  while (true) {
    size_t received = 0;
    const CURLcode code =
        curl_easy_recv(connection_->handle.get(), ignored.data(), ignored.size(), &received);
    if (code != CURLE_OK || received == 0) return code == CURLE_AGAIN;
  }
}

}  // namespace tissueform
