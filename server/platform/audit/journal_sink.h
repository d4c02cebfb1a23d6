// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/platform/audit/audit_sink.h"

namespace tissueform {

inline constexpr char kJournalSocket[] = "/run/systemd/journal/socket";

// systemd's journal. A message is taken when journald's queue has it: journald acknowledges
// nothing.
//
// Speaks the native protocol itself: sd_journal_sendv reports success when there is no journal, and
// waits without limit when journald does not read.
class JournalSink final : public AuditSink {
 public:
  // Connects. Errors: Unavailable: no journald reads the socket.
  static absl::StatusOr<std::unique_ptr<JournalSink>> Open(
      const AuditProgram& program, const std::string& socket_path = kJournalSocket);
  ~JournalSink() override;
  JournalSink(const JournalSink&) = delete;
  JournalSink& operator=(const JournalSink&) = delete;

  absl::Status Take(std::deque<std::string>* messages) override;

 private:
  JournalSink(const AuditProgram& program, std::string socket_path);

  absl::Status Connect();
  void Disconnect();
  absl::Status Error(const char* what) const;

  const std::string socket_path_;
  const std::string fields_;  // of every message
  int socket_ = -1;           // -1: not connected
};

}  // namespace tissueform
