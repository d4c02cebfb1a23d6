// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/attribute.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::StatusIs;

std::vector<Attribute> TwoArrays() {
  return {{"anatomy", 1, std::vector<uint8_t>{0, 2, 255}},
          {"normal", 3, std::vector<float>{0, 0, 1, 0, 1, 0, 1, 0, 0}}};
}

TEST(AttributeTest, ScalarsOfAnyTypeAreFoundAsDoubles) {
  ASSERT_OK_AND_ASSIGN(const std::vector<double> values,
                       FindScalars(TwoArrays(), "anatomy", "point"));
  EXPECT_THAT(values, ElementsAre(0, 2, 255));
  EXPECT_THAT(ToDoubles({"x", 1, std::vector<int64_t>{-1}}), ElementsAre(-1));
}

TEST(AttributeTest, TheErrorOfAMissingArrayListsTheExistingOnes) {
  EXPECT_THAT(FindScalars(TwoArrays(), "tissue", "cell"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("no cell array \"tissue\""), HasSubstr("anatomy, normal"))));
  EXPECT_THAT(FindScalars({}, "tissue", "cell"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it has none")));
  EXPECT_EQ(FindAttribute(TwoArrays(), "tissue"), nullptr);
}

TEST(AttributeTest, RefusesAThreeComponentArrayAsScalars) {
  EXPECT_THAT(FindScalars(TwoArrays(), "normal", "point"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 components")));
}

}  // namespace
}  // namespace tissueform
