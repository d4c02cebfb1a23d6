// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"

#include "server/platform/audit/audit_sink.h"

namespace tissueform {

// Makes RFC 5424 messages (facility 10, security; severity 5, notice) in the frames of RFC 5425:
// the length in bytes, a space, the message. Constant once made: thread-safe.
class SyslogFormat {
 public:
  explicit SyslogFormat(const AuditProgram& program);

  // `number` becomes the sequenceId, which shows duplicates and gaps: from 1, and 1 again after
  // 2147483647. `text` is printable ASCII.
  std::string Frame(int64_t number, absl::Time time, absl::string_view text) const;

 private:
  std::string source_;  // HOSTNAME APP-NAME PROCID MSGID
};

}  // namespace tissueform
