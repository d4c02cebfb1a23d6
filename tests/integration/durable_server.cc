// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/durable_server.h"

#include <chrono>
#include <csignal>
#include <fstream>
#include <optional>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

constexpr std::chrono::seconds kServerPatience{60};

}  // namespace

DurableServer::DurableServer(const std::string& name, std::vector<std::string> options)
    : folder_(std::filesystem::path(::testing::TempDir()) /
              absl::StrCat("tissueform_", name, "_", getpid())),
      options_(std::move(options)) {
  std::filesystem::remove_all(folder_);
}

DurableServer::~DurableServer() {
  process_.reset();
  std::filesystem::remove_all(folder_);
}

absl::Status DurableServer::Start() {
  const std::string port = address_.empty() ? "0" : address_.substr(address_.rfind(':') + 1);
  std::vector<std::string> arguments = {"--data-dir", folder_.string(), "--port", port};
  arguments.insert(arguments.end(), options_.begin(), options_.end());
  TF_ASSIGN_OR_RETURN(
      process_, ServerProcess::Start(ProgramPath("tissueform-server"), arguments, kServerPatience));
  address_ = process_->address();
  return absl::OkStatus();
}

absl::Status DurableServer::Kill() {
  std::ifstream lock(folder_ / "lock");
  pid_t pid = 0;
  lock >> pid;
  if (pid <= 1 || kill(pid, SIGKILL) != 0) return absl::InternalError("no server to kill");
  const bool ended = process_->WaitForExit(kServerPatience).has_value();
  process_.reset();
  return ended ? absl::OkStatus() : absl::InternalError("the server lives on");
}

absl::Status DurableServer::Drain() {
  process_->Terminate();
  const std::optional<int> code = process_->WaitForExit(kServerPatience);
  process_.reset();
  if (code == 0) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("the server ended with ", code.value_or(-1)));
}

absl::StatusOr<std::unique_ptr<TissueformClient>> DurableServer::Connect() const {
  TissueformClient::Options options;
  options.own_connection = true;
  options.call_deadline = kServerPatience;
  return TissueformClient::Connect(address_, options);
}

}  // namespace tissueform::testing
