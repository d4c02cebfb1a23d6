// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/helper_program.h"

#include <functional>
#include <new>
#include <stdexcept>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

TEST(HelperProgramTest, ExceptionsBecomeErrors) {
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
