// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <sys/types.h>

namespace tissueform {

// A tissueform-server as a child of this process. Ends with this object, and with this process
// whatever ends it.
class ServerProcess {
 public:
  // Starts `binary` with `arguments` and waits until it listens.
  //
  // Errors: NotFound (no such program), Unavailable (it ended, or did not listen in time).
  static absl::StatusOr<std::unique_ptr<ServerProcess>> Start(
      const std::string& binary, const std::vector<std::string>& arguments,
      std::chrono::milliseconds deadline);
  // SIGTERM, and SIGKILL when it has not ended in 30 s.
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  // HOST:PORT
  const std::string& address() const { return address_; }

  // SIGTERM: the server drains and ends.
  void Terminate();
  // Waits until it has ended. Its exit code (128 + signal when a signal ended it), or nothing when
  // it still runs at the deadline.
  std::optional<int> WaitForExit(std::chrono::milliseconds deadline);

 private:
  ServerProcess(pid_t pid, int output) : pid_(pid), output_(output) {}

  absl::Status WaitUntilListening(std::chrono::milliseconds deadline);

  const pid_t pid_;
  const int output_;              // read end of its stdout
  std::optional<int> exit_code_;  // set: the process is gone, and its pid may be another's
  std::string address_;
};

}  // namespace tissueform
