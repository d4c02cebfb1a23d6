// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

#include "spdlog/formatter.h"

namespace tissueform {

// What a line of the log is about, for programs that read it.
struct CallOfLogLine {
  std::string_view request_id;
  std::string_view method;
  std::string_view code;  // empty while the call is under way
  std::chrono::duration<double, std::milli> duration{0};
  std::string_view traceparent;  // empty: none
};

// Lines that this thread logs while it lives are about this call. What it names must outlive it;
// they do not nest.
class LogLinesOfCall {
 public:
  explicit LogLinesOfCall(const CallOfLogLine& call);
  ~LogLinesOfCall();
  LogLinesOfCall(const LogLinesOfCall&) = delete;
  LogLinesOfCall& operator=(const LogLinesOfCall&) = delete;
};

// One JSON object a line: time (UTC, RFC 3339), level, logger, message, and of a line that is about
// a call request_id, method, code, duration_ms and traceparent. What is no UTF-8 is replaced.
std::unique_ptr<spdlog::formatter> MakeJsonLines();

// "text" leaves what spdlog does; "json" makes objects of all lines of the program from now on.
void SetLogFormat(const std::string& format);

}  // namespace tissueform
