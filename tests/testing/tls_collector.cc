// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/tls_collector.h"

#include <array>
#include <chrono>
#include <cstdlib>
#include <poll.h>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <sys/socket.h>

namespace tissueform::testing {
namespace {

constexpr int kPollMilliseconds = 5;

void Require(bool condition) {
  if (!condition) std::abort();
}

// A reset and not an orderly end.
void Reset(int socket) {
  const linger now = {.l_onoff = 1, .l_linger = 0};
  setsockopt(socket, SOL_SOCKET, SO_LINGER, &now, sizeof(now));
  close(socket);
}

bool IsReadable(int socket) {
  pollfd ready = {.fd = socket, .events = POLLIN, .revents = 0};
  return poll(&ready, 1, kPollMilliseconds) > 0;
}

}  // namespace

struct TlsCollector::Tls {
  explicit Tls(const TestFiles& identity) : context(SSL_CTX_new(TLS_server_method())) {
    Require(SSL_CTX_use_certificate_chain_file(context, identity.certificate.c_str()) == 1);
    Require(SSL_CTX_use_PrivateKey_file(context, identity.key.c_str(), SSL_FILETYPE_PEM) == 1);
    Require(SSL_CTX_load_verify_locations(context, identity.roots.c_str(), nullptr) == 1);
    SSL_CTX_set_verify(context, SSL_VERIFY_PEER, nullptr);
  }
  ~Tls() { SSL_CTX_free(context); }
  SSL_CTX* const context;
};

TlsCollector::TlsCollector(const Options& options)
    : options_(options), tls_(std::make_unique<Tls>(options.identity)), reads_(options.reads) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int one = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
  // So that one who does not read fills soon.
  const int small = 4096;
  setsockopt(listener_, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small));
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(options.port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  // The port of an earlier collector may be in use for a moment.
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0) {
    Require(std::chrono::steady_clock::now() < end);
    std::this_thread::sleep_for(std::chrono::milliseconds(kPollMilliseconds));
  }
  Require(listen(listener_, 16) == 0);
  Require(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { Work(); });
}

TlsCollector::~TlsCollector() {
  ending_ = true;
  thread_.join();
  close(listener_);
}

std::vector<std::string> TlsCollector::messages() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return messages_;
}

std::string TlsCollector::peer_name() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return peer_name_;
}

void TlsCollector::Work() {
  while (!ending_) {
    if (IsReadable(listener_)) Serve(accept(listener_, nullptr, nullptr));
  }
}

void TlsCollector::Serve(int socket) {
  SSL* const ssl = SSL_new(tls_->context);
  SSL_set_fd(ssl, socket);
  if (SSL_accept(ssl) == 1) {
    ++connections_;
    X509* const peer = SSL_get_peer_certificate(ssl);
    std::array<char, 256> name = {};
    if (peer != nullptr) {
      X509_NAME_get_text_by_NID(X509_get_subject_name(peer), NID_commonName, name.data(),
                                name.size());
      X509_free(peer);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      peer_name_ = name.data();
    }
    std::string bytes;
    std::array<char, 4096> piece = {};
    size_t taken = 0;
    while (!ending_ && (options_.closes_after == 0 || taken < options_.closes_after)) {
      if (!reads_) {
        std::this_thread::sleep_for(std::chrono::milliseconds(kPollMilliseconds));
        continue;
      }
      if (SSL_pending(ssl) == 0 && !IsReadable(socket)) continue;
      const int count = SSL_read(ssl, piece.data(), static_cast<int>(piece.size()));
      if (count <= 0) break;
      bytes.append(piece.data(), static_cast<size_t>(count));
      taken += TakeFrames(&bytes);
    }
  }
  SSL_free(ssl);
  Reset(socket);
}

size_t TlsCollector::TakeFrames(std::string* bytes) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (size_t count = 0;; ++count) {
    const size_t space = bytes->find(' ');
    size_t length = 0;
    if (space == std::string::npos) return count;
    if (!absl::SimpleAtoi(bytes->substr(0, space), &length) || bytes->front() == '0') {
      messages_.emplace_back("BAD FRAME");
      bytes->clear();
      return count;
    }
    if (bytes->size() < space + 1 + length) return count;
    messages_.push_back(bytes->substr(space + 1, length));
    bytes->erase(0, space + 1 + length);
  }
}

}  // namespace tissueform::testing
