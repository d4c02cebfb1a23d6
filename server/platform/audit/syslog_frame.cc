// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/syslog_frame.h"

#include <algorithm>
#include <array>
#include <limits>
#include <unistd.h>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr int kPriority = 10 * 8 + 5;
constexpr int64_t kMaxSequenceId = std::numeric_limits<int32_t>::max();

// RFC 5424 wants the full name where it is known; "-" stands for none.
std::string HostName() {
  std::array<char, 256> name = {};
  if (gethostname(name.data(), name.size() - 1) != 0) return "-";
  const std::string host = name.data();
  const bool is_printable = !host.empty() && std::all_of(host.begin(), host.end(),
                                                         [](char c) { return c > 32 && c < 127; });
  return is_printable ? host : "-";
}

}  // namespace

SyslogFormat::SyslogFormat(const AuditProgram& program)
    : source_(absl::StrCat(HostName(), " ", program.name, " ", getpid(), " ", program.message_id)) {
}

std::string SyslogFormat::Frame(int64_t number, absl::Time time, absl::string_view text) const {
  const std::string message = absl::StrCat(
      "<", kPriority, ">1 ", absl::FormatTime("%Y-%m-%d%ET%H:%M:%E3SZ", time, absl::UTCTimeZone()),
      " ", source_, " [meta sequenceId=\"", (number - 1) % kMaxSequenceId + 1, "\"] ", text);
  return absl::StrCat(message.size(), " ", message);
}

}  // namespace tissueform
