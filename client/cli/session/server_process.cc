// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/server_process.h"

#include <array>
#include <cerrno>
#include <filesystem>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr char kListening[] = "listening on ";
// More than a server takes to drain if its drain time is not configured.
constexpr std::chrono::seconds kEndGrace{30};

}  // namespace

absl::StatusOr<std::unique_ptr<ServerProcess>> ServerProcess::Start(
    const std::string& binary, const std::vector<std::string>& arguments,
    std::chrono::milliseconds deadline) {
  const std::string name = std::filesystem::path(binary).filename();
  if (access(binary.c_str(), X_OK) != 0) {
    return absl::NotFoundError(absl::StrCat("no program ", binary, "; build it (target ", name,
                                            ") or install it in the folder of tissueform"));
  }
  ChildOptions options;
  options.program = binary;
  options.arguments = arguments;
  options.output = ChildStream::Pipe();
  TF_ASSIGN_OR_RETURN(std::unique_ptr<GuardedProgram> program,
                      GuardedProgram::Start(std::move(options), kEndGrace));
  std::unique_ptr<ServerProcess> process(new ServerProcess(name, std::move(program)));
  TF_RETURN_IF_ERROR(process->WaitUntilListening(deadline));
  return process;
}

std::optional<int> ServerProcess::WaitForExit(std::chrono::milliseconds deadline) {
  const std::optional<ChildEnd> end = program_->WaitFor(deadline);
  if (!end.has_value()) return std::nullopt;
  return end->exit_code;
}

absl::Status ServerProcess::WaitUntilListening(std::chrono::milliseconds deadline) {
  const auto end = SteadyClock::now() + deadline;
  std::string text;
  while (!absl::StrContains(text, "\n")) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - SteadyClock::now());
    pollfd readable{.fd = program_->answer(), .events = POLLIN, .revents = 0};
    const int ready = left.count() <= 0 ? 0 : poll(&readable, 1, static_cast<int>(left.count()));
    if (ready == 0) return absl::UnavailableError(absl::StrCat(name_, " was not ready in time"));
    if (ready < 0) return absl::CancelledError("interrupted");
    std::array<char, 256> buffer{};
    const ssize_t count = read(program_->answer(), buffer.data(), buffer.size());
    if (count > 0) {
      text.append(buffer.data(), count);
    } else if (count == 0) {
      return absl::UnavailableError(
          absl::StrCat(name_, " ended before it was ready; see its message above"));
    } else if (errno != EINTR) {
      return absl::ErrnoToStatus(errno, absl::StrCat("cannot read from ", name_));
    } else {
      return absl::CancelledError("interrupted");
    }
  }
  absl::string_view line = absl::string_view(text).substr(0, text.find('\n'));
  if (!absl::ConsumePrefix(&line, kListening)) {
    return absl::InternalError(absl::StrCat(name_, " did not print its address"));
  }
  address_ = std::string(line);
  return absl::OkStatus();
}

}  // namespace tissueform
