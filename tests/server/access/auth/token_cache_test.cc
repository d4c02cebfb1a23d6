// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_cache.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(TokenCacheTest, RespectsItsLimitAndEvictsTheOldest) {
  TokenCache cache(3);
  for (int i = 0; i < 10; ++i) {
    cache.Insert(absl::StrCat(i), {.token_id = absl::StrCat(i)}, cache.generation());
    EXPECT_LE(cache.size(), 3U);
  }
  EXPECT_FALSE(cache.Find("6").has_value());
  for (const char* digest : {"7", "8", "9"}) EXPECT_EQ(cache.Find(digest)->token_id, digest);
}

TEST(TokenCacheTest, InsertingATokenAgainDoesNotCountTwice) {
  TokenCache cache(2);
  cache.Insert("a", {}, cache.generation());
  for (int i = 0; i < 5; ++i) cache.Insert("b", {}, cache.generation());
  EXPECT_TRUE(cache.Find("a").has_value());
}

TEST(TokenCacheTest, RejectsTokensVerifiedWithOldKeys) {
  TokenCache cache;
  const int64_t before = cache.generation();
  cache.Insert("a", {}, before);
  cache.Clear();
  EXPECT_FALSE(cache.Find("a").has_value());
  cache.Insert("a", {}, before);
  EXPECT_FALSE(cache.Find("a").has_value());
  cache.Insert("a", {}, cache.generation());
  EXPECT_TRUE(cache.Find("a").has_value());
}

}  // namespace
}  // namespace tissueform
