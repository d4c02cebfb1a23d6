// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// What a process needs that only makes a mesh, prepares the `estimated` mode and answers once; a
// program of its own because it links nothing that reads files, as the server does not, and because
// a peak cannot be taken back.
//
//   tissueform-memory-probe BAR THREADS
//
// prints one JSON object.

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"

#include "client/lab/benchmarks/test_bars.h"
#include "core/base/freed_memory.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mesh/operators/laplacian.h"

namespace tissueform::benchmarks {
namespace {

// VmHWM: the most that has been resident so far.
int64_t PeakResidentBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    long long kib = 0;
    if (std::sscanf(line.c_str(), "VmHWM: %lld kB", &kib) == 1) {
      return int64_t{1024} * kib;
    }
  }
  return 0;
}

int64_t MeshBytes(const TetMesh& mesh) {
  return mesh.positions().size() * static_cast<int64_t>(sizeof(double)) +
         mesh.tets().size() * static_cast<int64_t>(sizeof(int32_t));
}

int64_t MatrixBytes(const TestBar& bar) {
  const SparseMatrix L = CotangentLaplacian(bar.mesh, bar.stiffness);
  return L.nonZeros() * static_cast<int64_t>(sizeof(double) + sizeof(int32_t)) +
         (L.cols() + 1) * static_cast<int64_t>(sizeof(int32_t));
}

absl::Status Probe(int number, int threads) {
  const int64_t baseline = PeakResidentBytes();
  ReturnFreedMemory();  // as the server does
  SetBlasThreads(1);
  TF_ASSIGN_OR_RETURN(const TestBar bar, MakeTestBar(number));
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.tolerance_mm = SidewaysTolerance(bar);
  options.threads = threads;
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                      CreateGradientFieldDeformer(bar.mesh, bar.stiffness, bar.ends, options));
  TF_RETURN_IF_ERROR(deformer->Deform(SidewaysPose(bar)).status());
  const int64_t peak = PeakResidentBytes();
  absl::PrintF(
      "{\"baseline_bytes\": %d, \"peak_bytes\": %d, \"factor_bytes\": %d, \"mesh_bytes\": %d, "
      "\"matrix_bytes\": %d}\n",
      baseline, peak, deformer->preparation().factor_bytes, MeshBytes(bar.mesh), MatrixBytes(bar));
  return absl::OkStatus();
}

}  // namespace
}  // namespace tissueform::benchmarks

int main(int argc, char** argv) {
  using tissueform::benchmarks::kBars;
  int bar = 0;
  int threads = 0;
  if (argc != 3 || !absl::SimpleAtoi(argv[1], &bar) || !absl::SimpleAtoi(argv[2], &threads) ||
      bar < 1 || bar > static_cast<int>(kBars.size()) || threads < 1) {
    std::cerr << "tissueform-memory-probe: give the number of a bar, 1 to " << kBars.size()
              << ", and a number of threads\n";
    return 2;
  }
  const absl::Status status = tissueform::benchmarks::Probe(bar, threads);
  if (!status.ok()) {
    std::cerr << "tissueform-memory-probe: " << status.message() << "\n";
    return 1;
  }
  return 0;
}
