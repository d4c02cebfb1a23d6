// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/benchmarks/memory_measurement.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "client/cli/shared/demo_paths.h"
#include "core/base/status_macros.h"

namespace tissueform::benchmarks {
namespace {

struct ClosePipe {
  void operator()(FILE* pipe) const { pclose(pipe); }
};

absl::StatusOr<std::string> ProbeProgram() {
  std::string program = SiblingProgram("tissueform-memory-probe");
  std::error_code error;
  if (!std::filesystem::is_regular_file(program, error)) {
    return absl::NotFoundError(
        absl::StrCat("no program ", program, "; build it (target tissueform-memory-probe)"));
  }
  return program;
}

absl::StatusOr<std::string> OutputOf(const std::string& command) {
  const std::unique_ptr<FILE, ClosePipe> pipe(popen(command.c_str(), "r"));
  if (pipe == nullptr) {
    return absl::ErrnoToStatus(errno, "cannot start the memory probe");
  }
  std::string output;
  char buffer[512];
  while (std::fgets(buffer, sizeof(buffer), pipe.get()) != nullptr) {
    output += buffer;
  }
  return output;
}

}  // namespace

absl::StatusOr<MemoryUse> MeasureMemory(const TestBar& bar, int threads) {
  TF_ASSIGN_OR_RETURN(const std::string program, ProbeProgram());
  TF_ASSIGN_OR_RETURN(const std::string output,
                      OutputOf(absl::StrCat("'", program, "' ", bar.number, " ", threads)));
  const auto json = nlohmann::json::parse(output, nullptr, false);
  if (!json.is_object()) {
    return absl::InternalError(absl::StrCat("the memory probe failed on bar ", bar.name));
  }
  MemoryUse use;
  use.bar = bar.number;
  use.mesh = bar.name;
  use.baseline_bytes = json.value("baseline_bytes", int64_t{0});
  use.peak_bytes = json.value("peak_bytes", int64_t{0});
  use.factor_bytes = json.value("factor_bytes", int64_t{0});
  use.mesh_bytes = json.value("mesh_bytes", int64_t{0});
  use.matrix_bytes = json.value("matrix_bytes", int64_t{0});
  return use;
}

}  // namespace tissueform::benchmarks
