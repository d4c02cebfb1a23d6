// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/contact_row.h"

#include <limits>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

const Eigen::Vector3d kX = Eigen::Vector3d::UnitX();
const Eigen::Vector3d kY = Eigen::Vector3d::UnitY();

// Ten vertices, of which 0 is fixed and 9 the only handle.
absl::StatusOr<ConstraintSet> With(const std::vector<ContactRow>& rows) {
  return ConstraintSet::Create(10, {0}, {{"jaw", {9}}}, rows);
}

TEST(ContactRowTest, RowsAreKeptInTheirOrderWithNormalsOfLengthOne) {
  const auto constraints = With({{.vertex = 3, .handle = 0, .normal = kX * (1 + 5e-7)},
                                 {.vertex = 2, .other = 4, .normal = kY, .gap_mm = 0.5},
                                 {.vertex = 3, .handle = 0, .normal = -kX}});
  ASSERT_THAT(constraints, IsOk());
  ASSERT_EQ(constraints->contact().size(), 3U);
  EXPECT_EQ(constraints->contact()[0].vertex, 3);
  EXPECT_EQ(constraints->contact()[0].normal, kX);
  EXPECT_EQ(constraints->contact()[1].gap_mm, 0.5);
  EXPECT_THAT(With({})->contact(), ::testing::IsEmpty());
}

TEST(ContactRowTest, ThereAreLimits) {
  const auto rows = [](size_t number, bool bilateral) {
    std::vector<ContactRow> all(number);
    for (size_t i = 0; i < number; ++i) {
      all[i].vertex = static_cast<int32_t>(i);
      all[i].bilateral = bilateral;
    }
    return all;
  };
  const std::vector<bool> is_free(kMaxContactRows + 1, false);
  EXPECT_THAT(CheckContactRows(rows(kMaxContactRows, true), is_free, 1), IsOk());
  EXPECT_THAT(CheckContactRows(rows(kMaxContactRows + 1, true), is_free, 1),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the limit is 16384")));
  EXPECT_THAT(CheckContactRows(rows(kMaxUnilateralRows, false), is_free, 1), IsOk());
  EXPECT_THAT(CheckContactRows(rows(kMaxUnilateralRows + 1, false), is_free, 1),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the limit is 1000")));
}

TEST(ContactRowTest, ErrorNamesTheInvalidRow) {
  const ContactRow good = {.vertex = 1};
  const struct {
    ContactRow row;
    std::string what;
  } cases[] = {
      {{.vertex = 10}, "names vertex 10, but the mesh has vertices 0 to 9"},
      {{.vertex = -1}, "names vertex -1"},
      {{.vertex = 0}, "names vertex 0, which moves with a region"},
      {{.vertex = 9}, "names vertex 9, which moves with a region"},
      {{.vertex = 2, .other = 9}, "names vertex 9, which moves with a region"},
      {{.vertex = 2, .other = 11}, "names vertex 11"},
      {{.vertex = 2, .other = -2}, "names vertex -2"},
      {{.vertex = 2, .other = 2}, "touch itself"},
      {{.vertex = 2, .other = 3, .handle = 0}, "names a handle between two vertices"},
      {{.vertex = 2, .handle = 1}, "names handle 1"},
      {{.vertex = 2, .handle = -2}, "names handle -2"},
      {{.vertex = 2, .normal = 2 * kX}, "normal of length 2"},
      {{.vertex = 2, .normal = Eigen::Vector3d::Constant(NAN)}, "normal of length nan"},
      {{.vertex = 2, .gap_mm = -0.1}, "gap of -0.1 mm"},
      {{.vertex = 2, .gap_mm = std::numeric_limits<double>::infinity()}, "gap of inf mm"},
      {{.vertex = 2, .other = 3, .bilateral = true}, "bilateral between two vertices"},
      {{.vertex = 2, .gap_mm = 0.1, .bilateral = true}, "bilateral with a gap of 0.1 mm"},
      {good, "repeats row 0"},
      {{.vertex = 1, .gap_mm = 3}, "repeats row 0"},
  };
  for (const auto& [row, what] : cases) {
    EXPECT_THAT(With({good, row}), StatusIs(absl::StatusCode::kInvalidArgument,
                                            AllOf(HasSubstr("contact row 1"), HasSubstr(what))));
  }
}

TEST(ContactRowTest, BilateralRowsOfAVertexAreOrthogonal) {
  const ContactRow along_x = {.vertex = 1, .normal = kX, .bilateral = true};
  EXPECT_THAT(With({along_x, {.vertex = 1, .normal = kY, .bilateral = true}}), IsOk());
  EXPECT_THAT(With({along_x, {.vertex = 1, .normal = (kX + kY).normalized(), .bilateral = true}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not orthogonal")));
  EXPECT_THAT(With({along_x, {.vertex = 1, .normal = -kX, .bilateral = true}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not orthogonal")));
}

}  // namespace
}  // namespace tissueform
