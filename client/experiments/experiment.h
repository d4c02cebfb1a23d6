// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

struct ExperimentOptions {
  std::string folder;  // must exist
  int threads = 1;

  std::string Path(absl::string_view name) const { return folder + "/" + std::string(name); }
};

// One figure or table of the source (Liao et al. 2009), computed again: writes its pictures (.png)
// and its numbers (.csv), all of whose names begin with the experiment's, into the folder. Pictures
// need an X display (VirtualDisplay).
struct Experiment {
  absl::string_view name;  // "fig1"
  absl::string_view topic;
  absl::Status (*run)(const ExperimentOptions& options);
};

// In the order of the source.
const std::vector<Experiment>& AllExperiments();

}  // namespace tissueform
