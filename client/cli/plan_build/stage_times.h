// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "core/base/stopwatch.h"

namespace tissueform {

// The stages of one long work: says on stderr what begins, how much of the whole is done and how
// long it took so far ("[ 42 %    3.1 s] meshing"), and keeps how long every stage took.
class StageTimes {
 public:
  struct Stage {
    std::string name;
    double seconds = 0;
  };

  // `fraction` of the whole is done, in [0, 1].
  void Begin(absl::string_view stage, double fraction);
  // The last stage has ended.
  void End();

  const std::vector<Stage>& stages() const { return stages_; }
  double TotalSeconds() const { return whole_.Seconds(); }

 private:
  Stopwatch whole_;
  double begun_seconds_ = 0;  // of the last stage
  bool running_ = false;
  std::vector<Stage> stages_;
};

}  // namespace tissueform
