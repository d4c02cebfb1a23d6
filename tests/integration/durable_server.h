// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/session/server_process.h"
#include "client/cpp/tissueform_client.h"

namespace tissueform::testing {

// The real program with a data folder of its own, which goes with this object: started, ended in
// both ways and started again.
class DurableServer {
 public:
  // `name` is that of its folder among those of this process. `options` beside folder and port.
  explicit DurableServer(const std::string& name, std::vector<std::string> options = {});
  ~DurableServer();
  DurableServer(const DurableServer&) = delete;
  DurableServer& operator=(const DurableServer&) = delete;

  // At the port of the one before, where there was one. Errors: those of ServerProcess.
  absl::Status Start();
  // As the power switch would, but for what the kernel still holds. Errors: Internal (it is not to
  // be found, or lives on).
  absl::Status Kill();
  // SIGTERM. Errors: Internal (it does not end, or not well).
  absl::Status Drain();

  // With a connection of its own.
  absl::StatusOr<std::unique_ptr<TissueformClient>> Connect() const;
  const std::string& address() const { return address_; }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  const std::filesystem::path folder_;
  const std::vector<std::string> options_;
  std::unique_ptr<ServerProcess> process_;
  std::string address_;
};

}  // namespace tissueform::testing
