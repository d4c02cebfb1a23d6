// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <thread>

#include "core/base/mutex.h"

namespace tissueform {

// What systemd is told by a service of Type=notify (sd_notify(3)). Nothing happens in a program
// that systemd has not started so.

void TellSystemdReady();
void TellSystemdStopping();

// Tells systemd that the program lives, as often as its unit's WatchdogSec asks, and no longer than
// the program itself says so: systemd ends a program that is silent, and starts it again.
class SystemdWatchdog {
 public:
  // Asks the program: `answered` is to be called once, by whatever thread, when it does its work.
  // It may be called, or thrown away, later than the watchdog ends.
  using Ask = std::function<void(std::function<void()> answered)>;

  // Asks four times in the time that systemd waits, one question at a time, on a thread of its own.
  explicit SystemdWatchdog(Ask ask);
  ~SystemdWatchdog();
  SystemdWatchdog(const SystemdWatchdog&) = delete;
  SystemdWatchdog& operator=(const SystemdWatchdog&) = delete;

 private:
  void Run(std::chrono::microseconds interval);

  const Ask ask_;

  Mutex mutex_;
  ConditionVariable stopped_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // none where nobody waits
};

}  // namespace tissueform
