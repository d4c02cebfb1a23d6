// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <string>

#include "absl/status/status.h"

namespace tissueform {

// The fixed fields of a program's audit messages.
struct AuditProgram {
  std::string name;        // "tissueform-server"; printable ASCII
  std::string message_id;  // syslog's MSGID: the format of the text
};

// Takes audit messages over. One thread at a time.
class AuditSink {
 public:
  virtual ~AuditSink() = default;

  // Takes messages from the front, in order, and removes those that it has taken. A message is one
  // line of printable ASCII without its line feed. Blocks for a second at most, apart from the
  // disk.
  //
  // Errors: Unavailable or ResourceExhausted, which say what to do; the front was not taken.
  virtual absl::Status Take(std::deque<std::string>* messages) = 0;

  // How much of its buffer is used, from 0 to 1. Thread-safe.
  virtual double BufferUse() const { return 0; }
};

}  // namespace tissueform
