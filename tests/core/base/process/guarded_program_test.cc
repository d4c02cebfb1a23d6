// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/guarded_program.h"

#include <array>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <unistd.h>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/killed_starter.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Closes;
using ::testing::HasSubstr;
using testing::KilledStarter;
using testing::ScopedEnvironment;
using testing::StatusIs;

constexpr std::chrono::seconds kGrace{60};

ChildOptions Program(const std::string& program) {
  ChildOptions options;
  options.program = program;
  return options;
}

ChildOptions Shell(const std::string& script) {
  ChildOptions options = Program("sh");
  options.arguments = {"-c", script};
  options.output = ChildStream::Pipe();
  options.errors = ChildStream::Null();
  return options;
}

// "sleep" as long as a test may take.
constexpr char kLasts[] = "echo begun; exec sleep 1000";
// Sleeps too, and cannot be asked to end.
constexpr char kIgnoresTerm[] = "trap '' TERM; echo begun; while :; do sleep 1000; done";

std::string ReadLine(int descriptor) {
  std::string line;
  for (char next = 0; read(descriptor, &next, 1) == 1 && next != '\n';) line += next;
  return line;
}

int ExitCodeOf(const std::string& script) {
  const auto program = GuardedProgram::Start(Shell(script), kGrace);
  return program.ok() ? (*program)->Wait().exit_code : -1;
}

TEST(GuardedProgramTest, ExitCodeComesThrough) {
  EXPECT_EQ(ExitCodeOf("exit 0"), 0);
  EXPECT_EQ(ExitCodeOf("exit 7"), 7);
  EXPECT_EQ(ExitCodeOf("kill -SEGV $$"), 128 + SIGSEGV);
}

TEST(GuardedProgramTest, OutputComesThroughAndEndsWithTheProgram) {
  ASSERT_OK_AND_ASSIGN(const auto program,
                       GuardedProgram::Start(Shell("read line; echo \"($line)\""), kGrace));
  EXPECT_EQ(ReadLine(program->answer()), "()") << "there is nothing to read";
  EXPECT_TRUE(Closes(program->answer()));
}

TEST(GuardedProgramTest, MissingProgramIsAnErrorOfTheStart) {
  EXPECT_THAT(GuardedProgram::Start(Program("no-such-program"), kGrace),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no-such-program")));
  EXPECT_THAT(GuardedProgram::Start(Program("/nowhere/sh"), kGrace),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere/sh")));
  const ScopedEnvironment no_programs("PATH", "/nonexistent");
  EXPECT_THAT(GuardedProgram::Start(Program("sh"), kGrace),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("sh")));
}

TEST(GuardedProgramTest, TerminatedProgramMayClearUp) {
  ASSERT_OK_AND_ASSIGN(
      const auto program,
      GuardedProgram::Start(Shell("trap 'kill $!; exit 5' TERM; sleep 1000 & echo begun; wait"),
                            kGrace));
  ASSERT_EQ(ReadLine(program->answer()), "begun");
  EXPECT_FALSE(program->WaitFor(std::chrono::milliseconds(0)).has_value());
  program->Terminate();
  EXPECT_EQ(program->Wait().exit_code, 5);
}

TEST(GuardedProgramTest, KillsAProgramThatIgnoresTermination) {
  ASSERT_OK_AND_ASSIGN(const auto program,
                       GuardedProgram::Start(Shell(kIgnoresTerm), std::chrono::milliseconds(1)));
  ASSERT_EQ(ReadLine(program->answer()), "begun");
  program->Terminate();
  EXPECT_EQ(program->Wait().exit_code, 128 + SIGKILL);
  EXPECT_TRUE(Closes(program->answer())) << "also what it has started";
}

TEST(GuardedProgramTest, RemainingChildrenEndWithTheProgram) {
  ASSERT_OK_AND_ASSIGN(const auto program,
                       GuardedProgram::Start(Shell("sleep 1000 & exit 3"), kGrace));
  EXPECT_EQ(program->Wait().exit_code, 3);
  EXPECT_TRUE(Closes(program->answer()));
}

TEST(GuardedProgramTest, SignalToTheGuardReachesTheProgram) {
  // The parent of a guarded program is its guard.
  ASSERT_OK_AND_ASSIGN(
      const auto program,
      GuardedProgram::Start(Shell("trap 'exit 6' TERM; kill -TERM $PPID; while :; do :; done"),
                            kGrace));
  EXPECT_EQ(program->Wait().exit_code, 6);
}

int ExitCodeWithin(const ProgramLimits& limits, const std::string& script) {
  const auto program = GuardedProgram::Start(Shell(script), kGrace, limits);
  return program.ok() ? (*program)->Wait().exit_code : -1;
}

TEST(GuardedProgramTest, LimitsProcessorTime) {
  EXPECT_EQ(ExitCodeWithin({.max_seconds = 1}, "while :; do :; done"), 128 + SIGKILL);
}

TEST(GuardedProgramTest, LimitsFileSizes) {
  const std::string file = ::testing::TempDir() + "guarded_file";
  const std::string write = "head -c 4096 /dev/zero > " + file + " && exit 9";
  EXPECT_EQ(ExitCodeWithin({.max_file_bytes = 4096}, write), 9);
  EXPECT_EQ(ExitCodeWithin({.max_file_bytes = 4095}, write), 1) << "told, and not ended";
}

TEST(GuardedProgramTest, LimitsMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers reserve terabytes of addresses";
#endif
  // dd asks for its block at once.
  const std::string need = "dd if=/dev/zero of=/dev/null bs=512M count=1 && exit 9";
  EXPECT_EQ(ExitCodeWithin({.max_memory_bytes = int64_t{2} << 30}, need), 9);
  EXPECT_EQ(ExitCodeWithin({.max_memory_bytes = int64_t{256} << 20}, need), 1);
}

// The pipe is held open by all that was started, and by nothing else.
class KilledStarterTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(pipe2(ends_.data(), O_CLOEXEC), 0); }
  void TearDown() override { close(ends_[0]); }

  // Starts the script in a process that is then killed.
  void StartAndKill(const std::string& script, std::chrono::milliseconds grace) {
    ChildOptions options = Shell(script);
    options.output = ChildStream::File("/proc/self/fd/" + std::to_string(ends_[1]));
    KilledStarter starter([&]() -> std::string {
      return GuardedProgram::Start(options, grace).value().release() != nullptr ? "started" : "";
    });
    close(ends_[1]);
    ASSERT_EQ(starter.word(), "started");
    ASSERT_EQ(ReadLine(ends_[0]), "begun");
    starter.Kill();
  }

  std::array<int, 2> ends_{};
};

TEST_F(KilledStarterTest, ItsProgramsEnd) {
  StartAndKill(kLasts, kGrace);
  EXPECT_TRUE(Closes(ends_[0]));
}

TEST_F(KilledStarterTest, ItsProgramsEndEvenIfTheyIgnoreTermination) {
  StartAndKill(kIgnoresTerm, std::chrono::milliseconds(1));
  EXPECT_TRUE(Closes(ends_[0]));
}

TEST(GuardProgramTest, ReportsWrongUse) {
  ASSERT_OK_AND_ASSIGN(const std::string guard, FindProgram("tissueform-guard"));
  ChildOptions silent = Program(guard);
  silent.errors = ChildStream::Null();
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(silent));
  EXPECT_EQ(child->Wait().exit_code, 2);
}

}  // namespace
}  // namespace tissueform
