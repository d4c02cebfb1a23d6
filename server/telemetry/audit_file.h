// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

#include "server/platform/audit_chain/audit_chain.h"
#include "server/platform/audit_chain/audit_key.h"

namespace tissueform {

// The files of an audit log (server/platform/audit_chain/audit_chain.h): the newest one under the
// log's own name, the others as PATH.000001, PATH.000002 or wherever somebody has moved them. A new
// one begins when a line would make the newest one larger than `max_bytes`, on a new day (UTC), and
// when the newest one is no longer where it was.
//
// One thread at a time.
class AuditFile {
 public:
  static constexpr int64_t kMaxBytes = int64_t{64} << 20;

  struct Options {
    std::string path;
    int64_t max_bytes = kMaxBytes;
    std::function<absl::Time()> now = [] { return absl::Now(); };
  };

  // Goes on where the log ended, with a line that says so; makes the first file, for its owner
  // only, where there is none. What a crash has left of a line is moved to PATH.torn-N, and a line
  // says so. A file that was sealed with another key is left, and the next one begins.
  //
  // Errors: FailedPrecondition (another process writes it), or what the disk says, naming the file.
  static absl::StatusOr<std::unique_ptr<AuditFile>> Open(AuditKey key, Options options);
  ~AuditFile();
  AuditFile(const AuditFile&) = delete;
  AuditFile& operator=(const AuditFile&) = delete;

  // Seals and writes a line for each (AuditChain::Seal) and waits until they are on the disk. Of
  // lines that could not be written nothing is left. Errors: what the disk says.
  absl::Status Append(const std::vector<std::string>& lines);

  const AuditPosition& position() const { return chain_.position(); }

 private:
  AuditFile(AuditKey key, Options options);

  // The file at the path, or a new one, locked; one that `begins` must be empty.
  absl::Status OpenAtPath(bool begins);
  absl::Status Resume();
  absl::Status SetAside(int64_t from, int64_t size);
  absl::Status Mend();
  // A new file in place of this one, which is given a name of its own unless it has been moved.
  absl::Status BeginNext();
  absl::Status MoveAway() const;
  bool IsAtPath() const;
  bool IsAsItWas() const;  // at its path, and nobody has written to it or cut it
  bool IsFull(size_t bytes) const;
  absl::Status Write(const std::string& bytes);
  absl::Status DiskError(const char* what) const;

  const Options options_;
  const AuditKey key_;
  AuditChain chain_;
  int fd_ = -1;
  int64_t size_ = 0;      // up to where it holds whole lines
  bool is_torn_ = false;  // it holds more
  absl::CivilDay day_;    // on which the file began, or was opened
};

}  // namespace tissueform
