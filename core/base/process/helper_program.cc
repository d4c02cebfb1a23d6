// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/helper_program.h"

#include <csignal>
#include <exception>
#include <fcntl.h>
#include <fstream>
#include <new>
#include <poll.h>
#include <string>
#include <thread>
#include <unistd.h>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitsMemory = false;
#else
constexpr bool kLimitsMemory = true;
#endif

constexpr int kUsageError = 2;
constexpr int kEndedByCaller = 128 + SIGKILL;
constexpr int64_t kMaxSeconds = INT32_MAX;

void SetLimit(int resource, int64_t value) {
  const rlimit limit{static_cast<rlim_t>(value), static_cast<rlim_t>(value)};
  setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

int64_t AddressSpaceBytes() {
  int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

// The stream under another number, closed on exec, with nothing in its place: libraries print to
// stdout, which is the way of the answer.
int TakeAway(int stream, int nowhere) {
  const int taken = fcntl(stream, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  dup2(nowhere, stream);
  return taken;
}

bool IsStartedByHand() {
  struct stat status {};
  return fstat(STDIN_FILENO, &status) != 0 || !S_ISSOCK(status.st_mode);
}

absl::StatusOr<IsolationLimits> ReceiveLimits(PipeReceiver* request) {
  IsolationLimits limits;
  TF_ASSIGN_OR_RETURN(const int64_t version, request->Number(INT64_MAX));
  if (version != kHelperCallVersion) {
    return absl::FailedPreconditionError(
        "a helper program has another version; install all programs of one build");
  }
  TF_ASSIGN_OR_RETURN(limits.max_memory_bytes, request->Number(INT64_MAX));
  TF_ASSIGN_OR_RETURN(const int64_t seconds, request->Number(kMaxSeconds));
  limits.max_seconds = static_cast<int>(seconds);
  TF_ASSIGN_OR_RETURN(limits.max_file_bytes, request->Number(INT64_MAX));
  return limits;
}

}  // namespace

namespace {

absl::Status NeedsMoreMemory(absl::string_view what, const IsolationLimits& limits) {
  return absl::ResourceExhaustedError(
      absl::StrCat(what, " needs more than ", limits.max_memory_bytes, " bytes of memory"));
}

// Libraries with threads of their own turn bad_alloc into errors of theirs. If a process gives up
// after using most of its memory limit, lack of memory is taken as the cause.
bool HasTakenMost(const IsolationLimits& limits) {
  if (!kLimitsMemory) return false;
  constexpr int64_t kBytesPerKibibyte = 1024;
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    absl::string_view rest = line;
    int64_t peak = 0;
    if (!absl::ConsumePrefix(&rest, "VmPeak:") || !absl::ConsumeSuffix(&rest, "kB")) continue;
    if (!absl::SimpleAtoi(absl::StripAsciiWhitespace(rest), &peak)) return false;
    return peak >= limits.max_memory_bytes / kBytesPerKibibyte / 4 * 3;
  }
  return false;
}

}  // namespace

absl::Status WithoutExceptions(absl::string_view what, const IsolationLimits& limits,
                               const std::function<absl::Status()>& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return NeedsMoreMemory(what, limits);
  } catch (const std::exception& exception) {
    if (HasTakenMost(limits)) return NeedsMoreMemory(what, limits);
    return absl::InvalidArgumentError(
        absl::StrCat("the library gave up while ", what, " (",
                     absl::StrReplaceAll(exception.what(), {{"\n", " "}}), ")"));
  } catch (...) {  // TetGen throws numbers
    return absl::InvalidArgumentError(
        absl::StrCat("the library gave up while ", what, "; it is damaged"));
  }
}

void EndWhenClosed(int descriptor) {
  // Asks for the hang-up only: a request that waits to be read must not wake it.
  std::thread([descriptor] {
    pollfd other_end{.fd = descriptor, .events = POLLRDHUP, .revents = 0};
    while (poll(&other_end, 1, -1) <= 0) {
    }
    _exit(kEndedByCaller);
  }).detach();
}

void BindToLimits(const IsolationLimits& limits) {
  std::signal(SIGXFSZ, SIG_IGN);  // so that writing fails, as on a full disk
  SetLimit(RLIMIT_CORE, 0);
  SetLimit(RLIMIT_FSIZE, limits.max_file_bytes);
  SetLimit(RLIMIT_CPU, limits.max_seconds);
  // Written so that a limit of "all there is" does not overflow.
  const int64_t present = AddressSpaceBytes();
  if (kLimitsMemory && limits.max_memory_bytes < INT64_MAX - present) {
    SetLimit(RLIMIT_AS, present + limits.max_memory_bytes);
  }
}

int RunHelperProgram(const std::function<void(const IsolationLimits& limits, PipeReceiver* request,
                                              PipeSender* answer)>& work) {
  if (IsStartedByHand()) {
    constexpr absl::string_view kExplanation =
        "this program is started by tissueform and does nothing by itself\n";
    return write(STDERR_FILENO, kExplanation.data(), kExplanation.size()) < 0 ? 1 : kUsageError;
  }
  std::signal(SIGPIPE, SIG_IGN);  // the answer to a caller that has gone is an error of PipeSender
  const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
  const int input = TakeAway(STDIN_FILENO, nowhere);
  const int output = TakeAway(STDOUT_FILENO, nowhere);
  dup2(nowhere, STDERR_FILENO);
  PipeSender answer(output);
  PipeReceiver head(input, INT64_MAX);
  const absl::StatusOr<IsolationLimits> limits = ReceiveLimits(&head);
  if (!limits.ok()) {
    answer.Outcome(limits.status());
    _exit(1);
  }
  EndWhenClosed(input);  // before the limit of memory, which counts from what there is by then
  BindToLimits(*limits);
  PipeReceiver request(input, limits->max_memory_bytes);
  work(*limits, &request, &answer);
  _exit(answer.ok() ? 0 : 1);
}

}  // namespace tissueform
