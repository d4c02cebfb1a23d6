// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/ending_signals.h"

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

namespace tissueform {
namespace {

// Where the handler writes. Handlers and a pipe, instead of blocked signals and a signalfd:
// OpenBLAS starts threads before main(), and they would not have the signals blocked.
std::atomic<int> noted_by_handler = -1;
static_assert(std::atomic<int>::is_always_lock_free, "read in a signal handler");

void Note(int number) {
  const int saved_errno = errno;
  const char byte = static_cast<char>(number);
  // A full pipe holds enough of them.
  [[maybe_unused]] const ssize_t written = write(noted_by_handler, &byte, 1);
  errno = saved_errno;
}

}  // namespace

absl::StatusOr<std::unique_ptr<EndingSignals>> EndingSignals::Catch() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
    return absl::ErrnoToStatus(errno, "cannot create a pipe");
  }
  return std::unique_ptr<EndingSignals>(new EndingSignals(ends));
}

EndingSignals::EndingSignals(const std::array<int, 2>& pipe_ends)
    : arrived_(pipe_ends[0]), noted_(pipe_ends[1]) {
  noted_by_handler = noted_;
  struct sigaction action {};
  action.sa_handler = Note;
  action.sa_flags = SA_RESTART;
  for (size_t i = 0; i < kNumbers.size(); ++i) {
    sigaction(kNumbers[i], nullptr, &former_[i]);
    const bool stays_ignored = kNumbers[i] == SIGHUP && former_[i].sa_handler == SIG_IGN;
    if (!stays_ignored) sigaction(kNumbers[i], &action, nullptr);
  }
}

EndingSignals::~EndingSignals() {
  for (size_t i = 0; i < kNumbers.size(); ++i) sigaction(kNumbers[i], &former_[i], nullptr);
  noted_by_handler = -1;
  close(arrived_);
  close(noted_);
}

bool EndingSignals::arrived() const {
  pollfd asked = {.fd = arrived_, .events = POLLIN, .revents = 0};
  return poll(&asked, 1, 0) == 1;
}

void EndingSignals::EndByArrived() const {
  char number = 0;
  std::_Exit(read(arrived_, &number, 1) == 1 ? 128 + number : EXIT_FAILURE);
}

}  // namespace tissueform
