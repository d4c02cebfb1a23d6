// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/test_authority.h"

namespace tissueform::testing {

// A collector of syslog messages over TLS on loopback, for one sender at a time. Asks for a
// certificate of `identity.roots`. The process must ignore SIGPIPE.
class TlsCollector {
 public:
  struct Options {
    TestFiles identity = {};
    int port = 0;  // 0: any free one
    bool reads = true;
    size_t closes_after = 0;  // resets each connection after so many messages; 0: never
  };

  explicit TlsCollector(const Options& options);
  ~TlsCollector();  // resets what is open
  TlsCollector(const TlsCollector&) = delete;
  TlsCollector& operator=(const TlsCollector&) = delete;

  int port() const { return port_; }
  // The messages without their lengths. A frame that is not well formed is "BAD FRAME".
  std::vector<std::string> messages() const;
  int connections() const { return connections_; }  // whose handshake succeeded
  std::string peer_name() const;                    // in the certificate of the last one
  void Read() { reads_ = true; }

 private:
  struct Tls;

  void Work();
  void Serve(int socket);
  // Takes whole frames from the front of `bytes`; how many.
  size_t TakeFrames(std::string* bytes);

  const Options options_;
  const std::unique_ptr<Tls> tls_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<bool> reads_;
  std::atomic<bool> ending_ = false;
  std::atomic<int> connections_ = 0;
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
  std::string peer_name_;
  std::thread thread_;
};

}  // namespace tissueform::testing
