// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <thread>

#include "core/base/mutex.h"

namespace tissueform {

// Messages that a service of Type=notify sends to systemd (sd_notify(3)). They have no effect in a
// program that systemd has not started in this way.

void NotifySystemdReady();
void NotifySystemdStopping();

// Notifies systemd that the program lives, as often as its unit's WatchdogSec asks, and no longer
// than the program itself says so: systemd ends a program that is silent, and starts it again.
class SystemdWatchdog {
 public:
  // Asks the program: `answered` is to be called once, by any thread, when the program does its
  // work. It may be called, or thrown away, after the watchdog has ended.
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

  std::thread thread_;  // not started if the unit has no watchdog
};

}  // namespace tissueform
