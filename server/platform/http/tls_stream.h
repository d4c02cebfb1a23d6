// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/certificates.h"

namespace tissueform {

// A connection over TLS 1.2 or later whose peer only reads. One thread at a time.
//
// REQUIRES: the process ignores SIGPIPE.
class TlsStream {
 public:
  struct Peer {
    std::string host;  // the name, or the address, that its certificate must have
    int port = 0;
    TlsFiles files = {};  // read at each connection; without authorities the system's count
    std::chrono::seconds connect_time{10};
    const std::atomic<bool>* stopping = nullptr;  // ends Connect and Send within a second
  };

  // Errors: those of CurlError, with what libcurl says of the certificate.
  static absl::StatusOr<std::unique_ptr<TlsStream>> Connect(const Peer& peer);
  ~TlsStream();
  TlsStream(const TlsStream&) = delete;
  TlsStream& operator=(const TlsStream&) = delete;

  // Sends all and waits until the peer's kernel has acknowledged it; its program need not have read
  // it. Errors: DeadlineExceeded (no progress for longer than `patience`), Cancelled (`stopping`),
  // Unavailable (the connection is broken).
  // After an error the connection is of no use.
  absl::Status Send(absl::string_view bytes, std::chrono::milliseconds patience);

  // Whether the peer has neither closed nor reset the connection. Does not block.
  bool IsOpen();

 private:
  struct Connection;
  explicit TlsStream(std::unique_ptr<Connection> connection);

  absl::Status WaitForAcknowledgment(std::chrono::milliseconds patience);

  const std::unique_ptr<Connection> connection_;
};

}  // namespace tissueform
