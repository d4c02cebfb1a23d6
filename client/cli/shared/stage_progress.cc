// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/stage_progress.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <signal.h>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_format.h"
#include <sys/time.h>

namespace tissueform {
namespace {

// What the signal handler writes, on whatever thread it runs: never freed. Zero bytes between
// stages.
char announcement[256];
std::atomic<size_t> announcement_bytes = 0;
std::atomic<bool> announced = false;
static_assert(std::atomic<size_t>::is_always_lock_free, "read in a signal handler");

void Announce(int /*signal*/) {
  const int saved_errno = errno;
  if (const size_t bytes = announcement_bytes; bytes > 0) {
    announced = write(STDERR_FILENO, announcement, bytes) > 0;
  }
  errno = saved_errno;
}

void SetTimer(int seconds) {
  const itimerval once{.it_interval = {}, .it_value = {seconds, 0}};
  setitimer(ITIMER_REAL, &once, nullptr);
}

}  // namespace

StageProgress::StageProgress(std::string stage) : stage_(std::move(stage)) {
  announced = false;
  const int bytes = absl::SNPrintF(announcement, sizeof(announcement), "%s ...\n", stage_);
  announcement_bytes = std::min(static_cast<size_t>(bytes), sizeof(announcement) - 1);
  struct sigaction action {};
  action.sa_handler = Announce;
  action.sa_flags = SA_RESTART;
  sigaction(SIGALRM, &action, nullptr);
  SetTimer(1);
}

StageProgress::~StageProgress() {
  SetTimer(0);
  announcement_bytes = 0;
  if (announced) absl::FPrintF(stderr, "%s: %.1f s\n", stage_, stopwatch_.Seconds());
}

}  // namespace tissueform
