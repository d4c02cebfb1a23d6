// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

struct ExperimentOptions {
  std::string folder;  // must exist
  int threads = 1;
  // The file of a bundled plan by its name, for experiments on meshes that are no grids.
  std::function<absl::StatusOr<std::string>(const std::string& name)> find_plan;
  // Of the experiment "accuracy": AccuracyCaseNames and "locking"; all when empty.
  std::vector<std::string> cases;
  // Of the experiment "ratios": plan files besides the bundled ones.
  std::vector<std::string> plans;
  // Gets a line for every step of a long experiment. May be empty.
  std::function<void(const std::string&)> on_step;

  void Report(const std::string& line) const {
    if (on_step) on_step(line);
  }

  std::string Path(absl::string_view name) const { return folder + "/" + std::string(name); }
};

// One figure or table of the source (Liao et al. 2009), computed again, or a study of our own:
// writes its pictures (.png) and its numbers (.csv), all of whose names begin with the
// experiment's, into the folder. Pictures need an X display (VirtualDisplay).
struct Experiment {
  absl::string_view name;  // "fig1"
  absl::string_view topic;
  absl::Status (*run)(const ExperimentOptions& options);
  // Not one of the source's: only run when it is asked for by its name.
  bool only_when_named = false;
};

// In the order of the source, our own after them.
const std::vector<Experiment>& AllExperiments();

}  // namespace tissueform
