// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/helper_call.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"
#include "tests/testing/busy_threads.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using testing::StatusIs;

constexpr int64_t kMaxBytes = 1 << 20;

// The text that a helper gives back after it has behaved so.
absl::StatusOr<std::string> Call(const std::string& behaviour, const IsolationLimits& limits = {},
                                 absl::string_view program = "process_test_helper") {
  std::string text;
  const absl::Status status = CallHelper(
      {program, "trying it", limits},
      [&behaviour](PipeSender* request) { request->Text(behaviour); },
      [&text](int descriptor) {
        PipeReceiver receiver(descriptor, kMaxBytes);
        TF_RETURN_IF_ERROR(receiver.Outcome());
        TF_RETURN_IF_ERROR(receiver.Number(INT32_MAX).status());
        TF_ASSIGN_OR_RETURN(text, receiver.Text());
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  return text;
}

TEST(HelperCallTest, AnswerArrives) {
  ASSERT_OK_AND_ASSIGN(const std::string text, Call("nothing"));
  EXPECT_EQ(text, "nothing");
}

TEST(HelperCallTest, ErrorArrivesAsItIs) {
  EXPECT_EQ(Call("fail").status(), absl::NotFoundError("not here"));
}

TEST(HelperCallTest, CrashIsAnError) {
  EXPECT_THAT(Call("be killed"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("trying it")));
  for (const char* behaviour : {"crash", "abort", "leave"}) {
    EXPECT_THAT(Call(behaviour), StatusIs(absl::StatusCode::kInvalidArgument,
                                          AllOf(HasSubstr("crashed"), HasSubstr("trying it"))))
        << behaviour;
  }
}

TEST(HelperCallTest, ExceptionsBecomeErrors) {
  EXPECT_THAT(Call("throw"), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("odd")));
}

TEST(HelperCallTest, ProcessorTimeIsLimited) {
  IsolationLimits limits;
  limits.max_seconds = 1;
  EXPECT_THAT(Call("loop", limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("1 seconds")));
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(HelperCallTest, MemoryIsLimited) {
  IsolationLimits limits;
  limits.max_memory_bytes = 64 << 20;
  EXPECT_THAT(Call("need memory", limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("bytes of memory")));
}
#endif

TEST(HelperCallTest, OutputIsDiscardedAndFilesStayEmpty) {
  const std::filesystem::path path = std::filesystem::path(::testing::TempDir()) / "helper_call";
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(Call("chatter"), IsOk());
  EXPECT_THAT(Call("write " + path.string()), IsOk());
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), IsEmpty());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
  EXPECT_EQ(std::filesystem::file_size(path), 0U);
  std::filesystem::remove(path);
}

TEST(HelperCallTest, ReportsAMissingHelperWithAdvice) {
  EXPECT_THAT(Call("nothing", {}, "tissueform-nothing"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("build it")));
}

TEST(HelperCallTest, ThreadsThatAllocateMayCallAtOnce) {
  const testing::BusyThreads busy(3);
  constexpr int kCallers = 4;
  std::vector<std::thread> callers;
  callers.reserve(kCallers);
  for (int t = 0; t < kCallers; ++t) {
    callers.emplace_back([t] {
      for (int i = 0; i < 10; ++i) {
        const std::string text = std::to_string(t) + "." + std::to_string(i);
        EXPECT_EQ(Call(text).value_or("failed"), text);
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
}

// The letter of the process's state in /proc, or nothing.
char StateOf(pid_t pid) {
  std::ifstream stream("/proc/" + std::to_string(pid) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const size_t name_end = text.rfind(") ");
  return name_end == std::string::npos ? 'X' : text[name_end + 2];
}

TEST(HelperCallTest, HelperEndsWhenItsCallerIsKilled) {
  ChildOptions options;
  ASSERT_OK_AND_ASSIGN(options.program, FindProgram("process_test_helper"));
  options.arguments = {"call"};
  options.output = ChildStream::Pipe();
  ASSERT_OK_AND_ASSIGN(const auto caller, ChildProcess::Start(options));
  std::string number;
  for (char next = 0; read(caller->answer(), &next, 1) == 1 && next != '\n';) number += next;
  const pid_t helper = std::atoi(number.c_str());
  ASSERT_GT(helper, 0);
  EXPECT_THAT(StateOf(helper), ::testing::AnyOf('R', 'S', 'D'));
  caller->Signal(SIGKILL);
  caller->Wait();
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  // A zombie has ended too; who inherits it may not reap.
  while (StateOf(helper) != 'X' && StateOf(helper) != 'Z') {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    std::this_thread::yield();
  }
}

TEST(HelperCallTest, HelperOfAnotherVersionIsRefused) {
  ChildOptions options;
  ASSERT_OK_AND_ASSIGN(options.program, FindProgram("process_test_helper"));
  options.input = ChildStream::Pipe();
  options.output = ChildStream::Pipe();
  ASSERT_OK_AND_ASSIGN(const auto helper, ChildProcess::Start(options));
  PipeSender(helper->request()).Number(kHelperCallVersion + 1);
  EXPECT_THAT(PipeReceiver(helper->answer(), kMaxBytes).Outcome(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another version")));
}

TEST(HelperCallTest, HelperStartedManuallyReportsWrongUse) {
  ChildOptions options;
  ASSERT_OK_AND_ASSIGN(options.program, FindProgram("process_test_helper"));
  options.errors = ChildStream::Null();
  ASSERT_OK_AND_ASSIGN(const auto helper, ChildProcess::Start(options));
  EXPECT_EQ(helper->Wait().exit_code, 2);
}

}  // namespace
}  // namespace tissueform
