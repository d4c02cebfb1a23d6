// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/process/guarded_program.h"

namespace tissueform {

// A tissueform-server or tissueform-gateway that this process has started. Ends with this object,
// and with this process for any reason: SIGTERM, and SIGKILL when it has not ended in 30 s.
class ServerProcess {
 public:
  // Starts `binary` with `arguments` and waits until it listens.
  //
  // Errors, naming the program: NotFound (the program is missing), Unavailable (it ended, or did
  // not listen in time).
  static absl::StatusOr<std::unique_ptr<ServerProcess>> Start(
      const std::string& binary, const std::vector<std::string>& arguments,
      std::chrono::milliseconds deadline);
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  // HOST:PORT
  const std::string& address() const { return address_; }

  // SIGTERM: the server drains and ends.
  void Terminate() { program_->Terminate(); }
  // Waits until it has ended. Its exit code (128 + signal when a signal ended it), or nothing when
  // it still runs at the deadline.
  std::optional<int> WaitForExit(std::chrono::milliseconds deadline);

 private:
  ServerProcess(std::string name, std::unique_ptr<GuardedProgram> program)
      : name_(std::move(name)), program_(std::move(program)) {}

  absl::Status WaitUntilListening(std::chrono::milliseconds deadline);

  const std::string name_;  // the program's, for errors
  const std::unique_ptr<GuardedProgram> program_;
  std::string address_;
};

}  // namespace tissueform
