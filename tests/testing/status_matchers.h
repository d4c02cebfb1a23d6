// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <ostream>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform::testing {

inline const absl::Status& GetStatus(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& GetStatus(const absl::StatusOr<T>& status_or) {
  return status_or.status();
}

// EXPECT_THAT(result, IsOk());
MATCHER(IsOk, "is OK") {
  *result_listener << GetStatus(arg).ToString();
  return GetStatus(arg).ok();
}

// EXPECT_THAT(result, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("vertex 7")));
MATCHER_P2(StatusIs, code, message_matcher, "") {
  const absl::Status& status = GetStatus(arg);
  *result_listener << status.ToString();
  return status.code() == code &&
         ::testing::ExplainMatchResult(message_matcher, std::string(status.message()),
                                       result_listener);
}

// What most refusals are.
inline constexpr absl::StatusCode kInvalid = absl::StatusCode::kInvalidArgument;

// With any message.
inline auto StatusIs(absl::StatusCode code) { return StatusIs(code, ::testing::_); }

// ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(...));
#define ASSERT_OK_AND_ASSIGN(declaration, expression) \
  ASSERT_OK_AND_ASSIGN_IMPL(TF_TEST_CONCAT(status_or_, __LINE__), declaration, expression)
#define ASSERT_OK_AND_ASSIGN_IMPL(status_or, declaration, expression) \
  auto status_or = (expression);                                      \
  ASSERT_TRUE(status_or.ok()) << status_or.status();                  \
  declaration = std::move(status_or).value()
#define TF_TEST_CONCAT(a, b) TF_TEST_CONCAT_IMPL(a, b)
#define TF_TEST_CONCAT_IMPL(a, b) a##b

}  // namespace tissueform::testing
