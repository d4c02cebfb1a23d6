// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/blas_threads.h"

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <unistd.h>

#include "absl/strings/string_view.h"

// OpenBLAS's own control; declared here because its header cblas.h clashes with other BLAS headers.
extern "C" void openblas_set_num_threads(int num_threads);
extern "C" char* openblas_get_corename();

namespace tissueform {

void SetBlasThreads(int threads) { openblas_set_num_threads(threads); }

void RestartWithFittingBlasKernels(char** argv) {
  constexpr char kChoice[] = "OPENBLAS_CORETYPE";
  if (std::getenv(kChoice) != nullptr) return;
  const absl::string_view chosen = openblas_get_corename();
  if (chosen != "Prescott") return;
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return;
  std::error_code error;
  const std::string program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error || setenv(kChoice, "Haswell", 1) != 0) return;
  execv(program.c_str(), argv);  // where it fails the old kernels do
}

}  // namespace tissueform
