// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/random_id.h"

#include <set>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(RandomIdTest, IdsAreThirtyTwoDigitsAndNeverTheSame) {
  constexpr size_t kIds = 1000;
  std::set<std::string> ids;
  for (size_t i = 0; i < kIds; ++i) {
    EXPECT_THAT(*ids.insert(RandomId()).first, ::testing::MatchesRegex("[0-9a-f]{32}"));
  }
  EXPECT_EQ(ids.size(), kIds);
}

}  // namespace
}  // namespace tissueform
