// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/journal_sink.h"

#include <cerrno>
#include <cstring>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr timeval kPatience = {.tv_sec = 1, .tv_usec = 0};
constexpr int kAuthPriv = 10;
constexpr int kNotice = 5;

}  // namespace

JournalSink::JournalSink(const AuditProgram& program, std::string socket_path)
    : socket_path_(std::move(socket_path)),
      fields_(absl::StrCat("SYSLOG_IDENTIFIER=", program.name, "-audit\nPRIORITY=", kNotice,
                           "\nSYSLOG_FACILITY=", kAuthPriv, "\nMESSAGE=")) {}

absl::StatusOr<std::unique_ptr<JournalSink>> JournalSink::Open(const AuditProgram& program,
                                                               const std::string& socket_path) {
  std::unique_ptr<JournalSink> sink(new JournalSink(program, socket_path));
  TF_RETURN_IF_ERROR(sink->Connect());
  return sink;
}

JournalSink::~JournalSink() { Disconnect(); }

absl::Status JournalSink::Connect() {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  if (socket_path_.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(
        absl::StrCat("audit journal ", socket_path_, ": the path of the socket is too long"));
  }
  std::strncpy(address.sun_path, socket_path_.c_str(), sizeof(address.sun_path) - 1);
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return Error("cannot open a socket");
  setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof(kPatience));
  if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    return absl::OkStatus();
  }
  absl::Status failed = Error("journald cannot be reached; start systemd-journald");
  Disconnect();
  return failed;
}

void JournalSink::Disconnect() {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
}

absl::Status JournalSink::Error(const char* what) const {
  return absl::UnavailableError(
      absl::StrCat("audit journal ", socket_path_, ": ", what, " (", std::strerror(errno), ")"));
}

absl::Status JournalSink::Take(std::deque<std::string>* messages) {
  while (!messages->empty()) {
    if (socket_ < 0) TF_RETURN_IF_ERROR(Connect());
    const std::string datagram = absl::StrCat(fields_, messages->front(), "\n");
    const ssize_t sent = send(socket_, datagram.data(), datagram.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) {
      absl::Status failed = errno == EAGAIN ? Error("journald does not read; check its disk")
                                            : Error("journald took no message; check its service");
      Disconnect();  // a journald that was restarted reads another socket
      return failed;
    }
    messages->pop_front();
  }
  return absl::OkStatus();
}

}  // namespace tissueform
