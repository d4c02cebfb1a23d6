// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/memory_measurement.h"

#include <array>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"

namespace tissueform::benchmarks {
namespace {

absl::StatusOr<std::string> OutputOf(const std::string& program,
                                     const std::vector<std::string>& arguments) {
  ChildOptions options;
  TF_ASSIGN_OR_RETURN(options.program, FindProgram(program));
  options.arguments = arguments;
  options.output = ChildStream::Pipe();
  TF_ASSIGN_OR_RETURN(const auto child, ChildProcess::Start(options));
  std::string output;
  std::array<char, 512> block{};
  for (ssize_t count = 0; (count = read(child->answer(), block.data(), block.size())) > 0;) {
    output.append(block.data(), static_cast<size_t>(count));
  }
  return output;
}

}  // namespace

absl::StatusOr<MemoryUse> MeasureMemory(const TestBar& bar, int threads) {
  TF_ASSIGN_OR_RETURN(
      const std::string output,
      OutputOf("tissueform-memory-probe", {absl::StrCat(bar.number), absl::StrCat(threads)}));
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
