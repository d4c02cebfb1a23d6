// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "gtest/gtest.h"

#include "core/base/instruction_set.h"

namespace tissueform::testing {

// Base of suites whose tests run once on each instruction set that the processor has: what they
// require of a kernel, they require of each of its versions.
//
//   class SmallProductTest : public testing::EveryInstructionSet {};
//   INSTANTIATE_TEST_SUITE_P(On, SmallProductTest, testing::InstructionSets(),
//                            testing::InstructionSetOf);
class EveryInstructionSet : public ::testing::TestWithParam<InstructionSet> {
 private:
  ScopedInstructionSet active_{GetParam()};
};

inline auto InstructionSets() { return ::testing::ValuesIn(SupportedInstructionSets()); }

inline std::string InstructionSetOf(const ::testing::TestParamInfo<InstructionSet>& info) {
  return std::string(InstructionSetName(info.param));
}

}  // namespace tissueform::testing
