// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/statusor.h"

#include "core/base/certificates.h"
#include "server/platform/audit/audit_sink.h"
#include "server/platform/audit/journal_sink.h"

namespace tissueform {

// Where a program sends its audit events.
struct AuditOptions {
  std::string target = {};       // "journal" or "syslog://HOST[:PORT]"; empty: no audit
  std::string authorities = {};  // of the collector's certificate, PEM; empty: the system's
  std::string buffer_folder = {};
  int64_t max_buffer_bytes = int64_t{256} << 20;
  std::string journal_socket = kJournalSocket;  // another one only in tests

  bool enabled() const { return !target.empty(); }
};

// Adds --audit and the options of its buffer; `folder` is the buffer's default as the help names
// it. `options` must outlive the parsing.
void AddAuditOptions(CLI::App& app, const std::string& folder, AuditOptions* options);

// The sink that the options name. `identity` is the program's certificate with its key, which the
// collector may request; empty: none. `folder` holds the buffer unless the options name another
// one; empty: there is no default.
//
// Errors: InvalidArgument (no such target, or no folder for a buffer); those of JournalSink::Open
// and CollectorSink::Open. REQUIRES: options.enabled().
absl::StatusOr<std::unique_ptr<AuditSink>> OpenAuditSink(const AuditOptions& options,
                                                         const AuditProgram& program,
                                                         const TlsFiles& identity,
                                                         const std::string& folder);

}  // namespace tissueform
