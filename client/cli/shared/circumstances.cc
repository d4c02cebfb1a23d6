// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/circumstances.h"

#include <fstream>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "core/base/software_version.h"

namespace tissueform {
namespace {

std::string Processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::vector<std::string> parts = absl::StrSplit(line, absl::MaxSplits(": ", 1));
    if (absl::StartsWith(line, "model name") && parts.size() == 2) {
      return parts[1];
    }
  }
  return "unknown processor";
}

}  // namespace

Circumstances MeasuringCircumstances() {
  return {absl::StrCat(Processor(), ", ", std::thread::hardware_concurrency(), " cores"),
          TISSUEFORM_COMPILER, SoftwareCommit()};
}

nlohmann::ordered_json CircumstancesJson() {
  const Circumstances circumstances = MeasuringCircumstances();
  return {{"machine", circumstances.machine},
          {"compiler", circumstances.compiler},
          {"commit", circumstances.commit}};
}

}  // namespace tissueform
