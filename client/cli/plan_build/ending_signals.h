// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <csignal>
#include <memory>

#include "absl/status/statusor.h"

namespace tissueform {

// While it is there, SIGINT, SIGTERM and, unless ignored as by nohup, SIGHUP do not end this
// process but make a descriptor readable, so that what has been begun can be taken away. One at a
// time.
class EndingSignals {
 public:
  // Errors: what the system says when there can be no pipe.
  static absl::StatusOr<std::unique_ptr<EndingSignals>> Catch();
  ~EndingSignals();
  EndingSignals(const EndingSignals&) = delete;
  EndingSignals& operator=(const EndingSignals&) = delete;

  // Readable when one has arrived.
  int descriptor() const { return arrived_; }

  // Whether one has arrived. Any thread.
  bool arrived() const;

  // Ends this process as the signal that arrived demands: with exit code 128 + signal and without
  // any cleanup. REQUIRES: one has arrived.
  [[noreturn]] void EndByArrived() const;

 private:
  static constexpr std::array<int, 3> kNumbers = {SIGINT, SIGTERM, SIGHUP};

  explicit EndingSignals(const std::array<int, 2>& pipe_ends);

  const int arrived_;
  const int noted_;
  std::array<struct sigaction, kNumbers.size()> former_{};
};

}  // namespace tissueform
