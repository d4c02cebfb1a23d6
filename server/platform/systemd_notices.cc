// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/systemd_notices.h"

#include <atomic>
#include <cstdint>
#include <utility>

#include <systemd/sd-daemon.h>

namespace tissueform {
namespace {

// Of the time after which systemd gives a program up.
constexpr int kQuestionsInThatTime = 4;

}  // namespace

void NotifySystemdReady() { sd_notify(0, "READY=1"); }
void NotifySystemdStopping() { sd_notify(0, "STOPPING=1"); }

SystemdWatchdog::SystemdWatchdog(Ask ask) : ask_(std::move(ask)) {
  uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return;
  const std::chrono::microseconds interval(
      static_cast<int64_t>(microseconds / kQuestionsInThatTime));
  thread_ = std::thread([this, interval] { Run(interval); });
}

SystemdWatchdog::~SystemdWatchdog() {
  if (!thread_.joinable()) return;
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    stopped_.NotifyAll();
  }
  thread_.join();
}

void SystemdWatchdog::Run(std::chrono::microseconds interval) {
  // Whether a question has no answer yet; lives as long as the last of those who answer.
  const auto open = std::make_shared<std::atomic<bool>>(false);
  auto next = std::chrono::steady_clock::now();
  for (;;) {
    if (!open->exchange(true)) {
      ask_([open] {
        sd_notify(0, "WATCHDOG=1");
        *open = false;
      });
    }
    next += interval;
    MutexLock lock(mutex_);
    while (!stopping_ && std::chrono::steady_clock::now() < next) {
      stopped_.WaitUntil(mutex_, next);
    }
    if (stopping_) return;
  }
}

}  // namespace tissueform
