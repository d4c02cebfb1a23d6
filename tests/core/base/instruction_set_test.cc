// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/instruction_set.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(InstructionSetTest, TheWidestSupportedOneIsActive) {
  const std::vector<InstructionSet> sets = SupportedInstructionSets();
  ASSERT_FALSE(sets.empty());
  EXPECT_EQ(ActiveInstructionSet(), sets.front());
  EXPECT_EQ(sets.back(), InstructionSet::kBaseline);
  for (size_t i = 1; i < sets.size(); ++i) {
    EXPECT_LT(RegisterBytes(sets[i]), RegisterBytes(sets[i - 1]));
  }
}

TEST(InstructionSetTest, AScopeChoosesTheVersionUntilItEnds) {
  static int called = 0;
  const KernelVersions<void()> versions{[] { called = 1; }, [] { called = 2; }, [] { called = 3; }};
  for (const InstructionSet set : SupportedInstructionSets()) {
    const ScopedInstructionSet active(set);
    versions.Active()();
    EXPECT_EQ(called, 1 + static_cast<int>(set)) << InstructionSetName(set);
  }
  EXPECT_EQ(ActiveInstructionSet(), SupportedInstructionSets().front());
}

}  // namespace
}  // namespace tissueform
