// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/identity.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(PrincipalTest, WithoutANameItIsAnonymous) {
  EXPECT_TRUE(Principal{}.anonymous());
  EXPECT_FALSE(Principal{"planner"}.anonymous());
  EXPECT_NE(Principal{"planner"}, Principal{});
}

}  // namespace
}  // namespace tissueform
