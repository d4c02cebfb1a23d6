// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/killed_starter.h"

#include <array>
#include <csignal>
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include <sys/wait.h>

namespace tissueform::testing {
namespace {

constexpr int kPatienceMilliseconds = 60000;

[[noreturn]] void StartAndWait(int to_parent, const std::function<std::string()>& start) {
  const std::string word = start();
  if (write(to_parent, word.data(), word.size()) < 0) _exit(1);
  close(to_parent);
  for (;;) pause();
}

}  // namespace

KilledStarter::KilledStarter(const std::function<std::string()>& start) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return;
  child_ = fork();
  if (child_ == 0) {
    close(ends[0]);
    StartAndWait(ends[1], start);
  }
  close(ends[1]);
  std::array<char, 256> block{};
  for (ssize_t count = 0; (count = read(ends[0], block.data(), block.size())) > 0;) {
    word_.append(block.data(), static_cast<size_t>(count));
  }
  close(ends[0]);
}

KilledStarter::~KilledStarter() { Kill(); }

void KilledStarter::Kill() {
  if (child_ <= 0) return;
  kill(child_, SIGKILL);
  waitpid(std::exchange(child_, 0), nullptr, 0);
}

bool Closes(int descriptor) {
  pollfd readable{.fd = descriptor, .events = POLLIN, .revents = 0};
  std::array<char, 256> ignored{};
  while (poll(&readable, 1, kPatienceMilliseconds) > 0) {
    if (read(descriptor, ignored.data(), ignored.size()) <= 0) return true;
  }
  return false;
}

}  // namespace tissueform::testing
