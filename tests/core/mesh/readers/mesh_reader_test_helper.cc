// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A mesh reader that takes the name of the file for what it is to do.

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

#include "core/mesh/readers/mesh_reader_call.h"
#include "tests/core/mesh/readers/reader_samples.h"

namespace tissueform {
namespace {

RawMesh WithArrays(const std::vector<std::string>& names, size_t size) {
  RawMesh mesh = testing::OneTriangle();
  for (const std::string& name : names) {
    mesh.point_data.push_back({name, 1, std::vector<double>(size)});
  }
  return mesh;
}

absl::StatusOr<RawMesh> Read(const CheckedMeshFile& file) {
  const std::string& wish = file.path;
  if (wish == "with arrays") return testing::TriangleWithArrays();
  if (wish == "large") return testing::LargerThanAPipe();
  if (wish == "fail") return absl::FailedPreconditionError("why");
  if (wish == "abort") std::abort();
  if (wish == "leave") _exit(0);
  if (wish == "crash") raise(SIGSEGV);
  if (wish == "throw an exception") throw std::runtime_error("odd");
  if (wish == "throw a number") throw 3;
  if (wish == "more memory than allowed") return WithArrays({"large"}, 300'000'000);
  if (wish == "a large mesh") return WithArrays({"a", "b", "c"}, 1'500'000);
  if (wish == "loop") {
    for (std::atomic<unsigned> turns = 0;; ++turns) {
    }
  }
  std::puts("chatter");
  std::fputs("chatter", stderr);
  std::fflush(stdout);
  std::ofstream(wish) << "contents";
  return testing::OneTriangle();
}

}  // namespace
}  // namespace tissueform

int main() { return tissueform::RunMeshReader(tissueform::Read); }
