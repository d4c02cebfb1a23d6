// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// The secret of an audit log's chain: 256 bits. Who has it can write lines that verify.
class AuditKey {
 public:
  // A file with 64 hexadecimal digits and a line feed (`openssl rand -hex 32` writes one), which
  // its owner alone may read. Errors: those of the disk; FailedPrecondition (others may read it);
  // InvalidArgument (holds something else). No message holds anything of it.
  static absl::StatusOr<AuditKey> Read(const std::string& path);
  // Makes a new one and writes it to a new file with mode 0600, synced. Errors: AlreadyExists,
  // those of the disk.
  static absl::Status WriteNew(const std::string& path);

  explicit AuditKey(std::string bytes);

  // HMAC-SHA-256 of the parts one after the other, in 64 lower-case hexadecimal digits.
  std::string Mac(const std::vector<absl::string_view>& parts) const;
  // Says which key it is and nothing of it: 16 hexadecimal digits.
  std::string Id() const;

 private:
  std::string bytes_;
};

}  // namespace tissueform
