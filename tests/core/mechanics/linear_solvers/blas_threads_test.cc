// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/blas_threads.h"

#include <array>
#include <cstdlib>
#include <string>
#include <unistd.h>

#include "gtest/gtest.h"
#include <sys/wait.h>

extern "C" char* openblas_get_corename();

namespace tissueform {
namespace {

// The exit code of a child process that asks for fitting kernels. The program that it restarts,
// if it does, is this one with the given arguments.
int ExitCodeOfAsking(const char* chosen_kernels) {
  const pid_t child = fork();
  if (child == 0) {
    if (chosen_kernels != nullptr) {
      setenv("OPENBLAS_CORETYPE", chosen_kernels, 1);
    } else {
      unsetenv("OPENBLAS_CORETYPE");
    }
    std::string program = "blas_threads_test";
    std::string filter = "--gtest_filter=BlasThreadsTest.ProgramRestartsOnlyIfItsKernelsDoNotFit";
    std::array<char*, 3> argv = {program.data(), filter.data(), nullptr};
    RestartWithFittingBlasKernels(argv.data());
    _exit(7);  // it has returned
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool NeedsOthers() {
  return std::string(openblas_get_corename()) == "Prescott" &&
         __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
}

TEST(BlasThreadsTest, ProgramRestartsOnlyIfItsKernelsDoNotFit) {
  if (std::getenv("OPENBLAS_CORETYPE") != nullptr) {
    EXPECT_FALSE(NeedsOthers());  // this is the program that was restarted
    return;
  }
  EXPECT_EQ(ExitCodeOfAsking(nullptr), NeedsOthers() ? 0 : 7);
}

TEST(BlasThreadsTest, ChoiceOfTheEnvironmentStays) { EXPECT_EQ(ExitCodeOfAsking("Prescott"), 7); }

}  // namespace
}  // namespace tissueform
