// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/process/isolated_process.h"

#include <csignal>
#include <functional>
#include <new>
#include <stdexcept>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/process/pipe_stream.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

constexpr int64_t kMostBytes = 1 << 20;

// What came back from a child that does `work` and then sends `number`.
absl::StatusOr<int64_t> RunAndReceive(const std::function<void()>& work, int64_t number,
                                      const IsolationLimits& limits = {}) {
  int64_t received = -1;
  const absl::Status status = RunIsolated(
      "trying it", limits,
      [&](int descriptor) {
        work();
        PipeSender sender(descriptor);
        sender.Number(number);
        return sender.ok();
      },
      [&](int descriptor) {
        PipeReceiver receiver(descriptor, kMostBytes);
        const absl::StatusOr<int64_t> got = receiver.Number(kMostBytes);
        if (got.ok()) received = *got;
        return got.status();
      });
  if (!status.ok()) return status;
  return received;
}

TEST(IsolatedProcessTest, ResultArrives) {
  const absl::StatusOr<int64_t> number = RunAndReceive([] {}, 42);
  ASSERT_THAT(number, IsOk());
  EXPECT_EQ(*number, 42);
}

TEST(IsolatedProcessTest, NothingOfTheChildIsLeftInThisProcess) {
  int touched = 0;
  ASSERT_THAT(RunAndReceive([&touched] { touched = 1; }, 1), IsOk());
  EXPECT_EQ(touched, 0);
}

TEST(IsolatedProcessTest, CrashIsAnError) {
  EXPECT_THAT(RunAndReceive([] { std::raise(SIGKILL); }, 1),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("trying it")));
  EXPECT_THAT(RunAndReceive([] { std::raise(SIGSEGV); }, 1),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("crashed"), HasSubstr("trying it"))));
}

TEST(IsolatedProcessTest, ProcessorTimeIsLimited) {
  volatile bool forever = true;
  IsolationLimits limits;
  limits.max_seconds = 1;
  EXPECT_THAT(RunAndReceive(
                  [&forever] {
                    while (forever) {
                    }
                  },
                  1, limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("1 seconds")));
}

TEST(IsolatedProcessTest, ExceptionsBecomeErrors) {
  const auto outcome = [](const std::function<absl::Status()>& work) {
    return WithoutExceptions("trying it", {}, work);
  };
  EXPECT_THAT(outcome([] { return absl::OkStatus(); }), IsOk());
  EXPECT_THAT(outcome([]() -> absl::Status { throw std::runtime_error("odd"); }),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("odd"), HasSubstr("trying it"))));
  EXPECT_THAT(outcome([]() -> absl::Status { throw 1; }),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("gave up")));
  EXPECT_THAT(outcome([]() -> absl::Status { throw std::bad_alloc(); }),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

}  // namespace
}  // namespace tissueform
