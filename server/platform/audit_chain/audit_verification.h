// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/platform/audit_chain/audit_chain.h"
#include "server/platform/audit_chain/audit_key.h"

namespace tissueform {

enum class AuditFault {
  kChanged,      // a line was changed
  kRemoved,      // lines are missing
  kInserted,     // a line that was not written there
  kOutOfOrder,   // lines have changed places
  kCut,          // the end of a file is missing
  kMissingFile,  // a file between two others
  kWrongKey,     // nothing was sealed with this key
};
absl::string_view AuditFaultName(AuditFault fault);  // "changed", "missing file"

// The first thing that is wrong.
struct AuditFinding {
  AuditFault fault = AuditFault::kChanged;
  std::string file;
  int64_t line = 0;  // in the file, from 1
  std::string what;  // a sentence
};

struct AuditReport {
  int64_t files = 0;
  int64_t lines = 0;  // that are right, from the first one on
  uint64_t first = 0;
  AuditPosition last;
  // What the server itself has noted in the chain.
  int64_t mended = 0;                   // beginnings of lines that a crash has left, set aside
  int64_t lost = 0;                     // notes of lines that could not be kept
  std::optional<AuditFinding> finding;  // empty: all is right
};

// Reads files of one log, in whatever order they are named, and compares them with checkpoints that
// were kept elsewhere. Without those nobody can tell whether whole lines at the very end are
// missing.
//
// Errors: InvalidArgument (no file), or what the disk says. What is wrong with a log is no error.
absl::StatusOr<AuditReport> VerifyAuditFiles(const std::vector<std::string>& paths,
                                             const AuditKey& key,
                                             const std::vector<AuditCheckpoint>& checkpoints = {});

// Those in a file of a system log, whatever else it holds. Errors: what the disk says.
absl::StatusOr<std::vector<AuditCheckpoint>> ReadCheckpoints(const std::string& path);

}  // namespace tissueform
