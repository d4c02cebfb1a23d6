// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/child_process.h"

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>
#include <unistd.h>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/process/pipe_stream.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::StatusIs;

namespace fs = std::filesystem;

ChildOptions Helper(std::vector<std::string> arguments) {
  ChildOptions options;
  options.program = FindProgram("process_test_helper").value();
  options.arguments = std::move(arguments);
  return options;
}

std::string ReadToEnd(int descriptor) {
  std::string text;
  std::array<char, 256> block{};
  for (ssize_t count = 0; (count = read(descriptor, block.data(), block.size())) > 0;) {
    text.append(block.data(), static_cast<size_t>(count));
  }
  return text;
}

TEST(ChildProcessTest, ExitCodeIsAValue) {
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(Helper({"leave", "and", "more"})));
  const ChildEnd end = child->Wait();
  EXPECT_EQ(end.exit_code, 4);
  EXPECT_EQ(end.signal, 0);
  EXPECT_EQ(child->Wait().exit_code, 4);  // again
}

TEST(ChildProcessTest, SignalThatEndedItIsAValue) {
  ChildOptions options = Helper({"tell", "wait"});
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(options));
  child->Signal(SIGTERM);
  const ChildEnd end = child->Wait();
  EXPECT_EQ(end.exit_code, -1);
  EXPECT_EQ(end.signal, SIGTERM);
  child->Signal(SIGTERM);  // reaches no process
}

TEST(ChildProcessTest, DeadlinePassesWhileItRuns) {
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(Helper({"tell", "wait"})));
  EXPECT_FALSE(child->WaitFor(std::chrono::milliseconds(0)).has_value());
  child->Signal(SIGKILL);
  const std::optional<ChildEnd> end = child->WaitFor(std::chrono::seconds(60));
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->signal, SIGKILL);
}

TEST(ChildProcessTest, ItEndsWithItsObject) {
  pid_t pid = 0;
  {
    ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(Helper({"tell", "wait"})));
    pid = child->pid();
    EXPECT_EQ(kill(pid, 0), 0);
  }
  EXPECT_NE(kill(pid, 0), 0);  // reaped too
}

TEST(ChildProcessTest, StreamsFolderEnvironmentAndGroupAreThoseAskedFor) {
  const std::string folder = fs::canonical(fs::temp_directory_path()).string();
  ChildOptions options = Helper({"tell"});
  options.input = ChildStream::Pipe();
  options.output = ChildStream::Pipe();
  options.folder = folder;
  options.environment = {"TISSUEFORM_TEST_VALUE=7"};
  options.own_group = true;
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(options));
  PipeSender(child->request()).Bytes("hello\n", 6);
  EXPECT_EQ(ReadToEnd(child->answer()), "hello|7|" + folder + "|own group\n");
  EXPECT_EQ(child->Wait().exit_code, 0);
}

TEST(ChildProcessTest, StreamsMayBeFiles) {
  const fs::path in = fs::path(::testing::TempDir()) / "child_process_test.in";
  const fs::path out = fs::path(::testing::TempDir()) / "child_process_test.out";
  std::ofstream(in) << "from a file\n";
  std::ofstream(out) << std::string(1000, 'x');
  ChildOptions options = Helper({"tell"});
  options.input = ChildStream::File(in.string());
  options.output = ChildStream::File(out.string());
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(options));
  EXPECT_EQ(child->Wait().exit_code, 0);
  EXPECT_THAT(testing::BytesOfFile(out),
              AllOf(::testing::StartsWith("from a file||"), HasSubstr("same group\n"),
                    ::testing::Not(HasSubstr("xx"))));
  fs::remove(in);
  fs::remove(out);
}

TEST(ChildProcessTest, InputEndsWhenTheRequestIsClosed) {
  ChildOptions options = Helper({"tell"});
  options.input = ChildStream::Pipe();
  options.output = ChildStream::Pipe();
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(options));
  child->CloseRequest();
  EXPECT_THAT(ReadToEnd(child->answer()), ::testing::StartsWith("||"));
}

TEST(ChildProcessTest, WritingToOneThatHasEndedIsAnError) {
  ChildOptions options = Helper({"leave"});
  options.input = ChildStream::Pipe();
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(options));
  child->Wait();
  PipeSender sender(child->request());
  sender.Text("is anybody there");
  EXPECT_FALSE(sender.ok());
}

TEST(ChildProcessTest, ItOutlivesTheThreadThatStartedIt) {
  ChildOptions options = Helper({"tell"});
  options.input = ChildStream::Pipe();
  options.output = ChildStream::Pipe();
  std::unique_ptr<ChildProcess> child;
  std::thread([&] { child = ChildProcess::Start(options).value(); }).join();
  PipeSender(child->request()).Bytes("still here\n", 11);
  EXPECT_THAT(ReadToEnd(child->answer()), ::testing::StartsWith("still here|"));
}

TEST(ChildProcessTest, ReportsAMissingProgramWithAdvice) {
  ChildOptions options;
  options.program = "/nonexistent/program";
  EXPECT_THAT(ChildProcess::Start(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nonexistent/program")));
  EXPECT_THAT(
      FindProgram("tissueform-nothing"),
      StatusIs(absl::StatusCode::kNotFound, AllOf(HasSubstr("build it (target tissueform-nothing)"),
                                                  HasSubstr("libexec/tissueform"))));
}

}  // namespace
}  // namespace tissueform
