// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/tissueform_command.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <poll.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include <sys/statvfs.h>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kCommandGrace{2};
constexpr std::chrono::milliseconds kCancelPause{100};
constexpr size_t kMaxLineBytes = 400;
constexpr int kSignalled = 128;  // exit codes beyond: GuardedProgram
// Less is no room for pictures and a case.
constexpr uint64_t kLeastRoomBytes = 64 << 20;

// The last line that is not empty, without control characters.
std::string LastLine(const std::string& path) {
  std::ifstream file(path);
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) last = line.substr(0, kMaxLineBytes);
  }
  for (char& c : last) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  return last;
}

bool IsReadable(int descriptor) {
  pollfd asked = {.fd = descriptor, .events = POLLIN, .revents = 0};
  return descriptor >= 0 && poll(&asked, 1, 0) > 0;
}

}  // namespace

bool HasRoom(const std::string& folder) {
  struct statvfs disk = {};
  if (statvfs(folder.c_str(), &disk) != 0) return true;
  return uint64_t{disk.f_bavail} * disk.f_frsize >= kLeastRoomBytes;
}

absl::Status RunTissueform(const std::vector<std::string>& arguments, absl::string_view what,
                           const std::string& log, std::chrono::seconds most_time, int cancel,
                           const ProgramLimits& limits) {
  ChildOptions options;
  TF_ASSIGN_OR_RETURN(options.program, FindProgram("tissueform"));
  options.arguments = arguments;
  options.output = ChildStream::File(log);
  options.errors = ChildStream::File(log);
  TF_ASSIGN_OR_RETURN(const auto child,
                      GuardedProgram::Start(std::move(options), kCommandGrace, limits));
  const auto latest = std::chrono::steady_clock::now() + most_time;
  std::optional<ChildEnd> end;
  while (!(end = child->WaitFor(kCancelPause)).has_value()) {
    if (IsReadable(cancel)) return absl::CancelledError(absl::StrCat(what, " was interrupted"));
    if (std::chrono::steady_clock::now() > latest) {
      return absl::DeadlineExceededError(absl::StrCat(what, " took too long and was stopped"));
    }
  }
  if (end->exit_code == 0) return absl::OkStatus();
  // It says so in words only, and where there is no room its log has none of them either.
  if (!HasRoom(fs::path(log).parent_path().string())) {
    return WithReason(absl::ResourceExhaustedError(
                          absl::StrCat(what, " failed: the disk is full; free some space")),
                      ErrorReason::kDiskFull);
  }
  if (end->exit_code > kSignalled) {
    return absl::FailedPreconditionError(
        absl::StrCat(what, " failed: stopped by signal ", end->exit_code - kSignalled));
  }
  return absl::FailedPreconditionError(absl::StrCat(what, " failed: ", LastLine(log)));
}

}  // namespace tissueform
