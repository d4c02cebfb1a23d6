// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/cli/doctor/doctor_report.h"

namespace tissueform {

// How long one question to the network may take.
inline constexpr std::chrono::seconds kProbeDeadline{5};

struct ServerEndpoint {
  std::string host;  // IPv6 without brackets
  std::string port;
};

// Of "HOST:PORT" and "[::1]:PORT". Error: InvalidArgument.
absl::StatusOr<ServerEndpoint> ParseEndpoint(const std::string& address);

// A connected socket that does not block; closed at its end.
class ProbeSocket {
 public:
  explicit ProbeSocket(int fd = -1) : fd_(fd) {}
  ProbeSocket(ProbeSocket&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  ProbeSocket& operator=(ProbeSocket&&) = delete;
  ~ProbeSocket();

  int fd() const { return fd_; }
  // False when it has neither come to read nor to write by then.
  bool Wait(short events, std::chrono::steady_clock::time_point deadline) const;

 private:
  int fd_;
};

// Whether the name is one: what the line says are its addresses.
DoctorLine CheckName(const ServerEndpoint& endpoint);
// Whether a program accepts connections there.
DoctorLine CheckRoute(const ServerEndpoint& endpoint);
// Errors: Unavailable.
absl::StatusOr<ProbeSocket> ConnectProbe(const ServerEndpoint& endpoint);

// The first bytes that a peer says to a client that begins HTTP/2 without encryption; empty: it
// says nothing and closes, or waits. Errors: those of ConnectProbe.
absl::StatusOr<std::string> AnswerToPlainHttp2(const ServerEndpoint& endpoint);

}  // namespace tissueform
