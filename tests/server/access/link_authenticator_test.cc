// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/link_authenticator.h"

#include <chrono>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/access/access_changes.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::MatchesRegex;
using Code = absl::StatusCode;

// Accepts any credentials.
class Everybody final : public Authenticator {
 public:
  absl::StatusOr<Authenticated> Authenticate(const Credentials& /*credentials*/) override {
    return Authenticated{.principal = std::make_shared<const Principal>(Principal{.name = "ann"})};
  }
  absl::Status IsStillAuthorized(const Authenticated& /*authenticated*/) override {
    return absl::OkStatus();
  }
};

class LinkAuthenticatorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    SessionRecord session;
    session.id = "s";
    session.owner = "ann";
    ASSERT_THAT(CreateSession(store_.stores->sessions(), session), IsOk());
    ASSERT_THAT(
        changes_.AddLink({.name = "ann"},
                         {.digest = DigestOfLinkToken(token_), .session = "s", .expires_s = 1010}),
        IsOk());
  }

  absl::StatusOr<Authenticated> Come(const std::string& header) {
    return links_.Authenticate({.authorization = {header}});
  }

  const std::string token_ = NewLinkToken();
  int64_t now_s_ = 1000;
  InMemoryAccessStore store_;
  AccessQueries queries_{store_.database()};
  Access access_{&queries_, [this] { return now_s_; }};
  AccessChanges changes_{{}, &store_, &access_};
  Everybody everybody_;
  LinkAuthenticator links_{&access_, &everybody_};
};

TEST_F(LinkAuthenticatorTest, ATokenIsLongRandomAndSafeInAUrl) {
  EXPECT_THAT(token_, MatchesRegex("tfl_[A-Za-z0-9_-]+"));
  EXPECT_EQ(token_.size(), 47U);
  EXPECT_NE(NewLinkToken(), token_);
}

TEST_F(LinkAuthenticatorTest, ValidLinkIsBoundToItsSessionAndExpires) {
  ASSERT_OK_AND_ASSIGN(const Authenticated link, Come("Bearer " + token_));
  EXPECT_EQ(link.principal->name, "link:s");
  EXPECT_EQ(link.principal->only_session, "sessions/s");
  EXPECT_EQ(link.token_id, DigestOfLinkToken(token_));
  EXPECT_EQ(link.expires, std::chrono::system_clock::time_point(std::chrono::seconds(1010)));
  EXPECT_THAT(links_.IsStillAuthorized(link), IsOk());
  now_s_ = 1010;
  EXPECT_THAT(links_.IsStillAuthorized(link), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(Come("Bearer " + token_), StatusIs(Code::kUnauthenticated));
}

TEST_F(LinkAuthenticatorTest, RevokedLinkIsNoLongerValid) {
  ASSERT_OK_AND_ASSIGN(const Authenticated link, Come("bearer " + token_));
  ASSERT_THAT(changes_.RemoveLinks({.name = "ann"}, "s"), IsOk());
  EXPECT_THAT(links_.IsStillAuthorized(link), StatusIs(Code::kUnauthenticated));
}

TEST_F(LinkAuthenticatorTest, RefusesInvalidLinkTokens) {
  EXPECT_THAT(Come("Bearer " + NewLinkToken()), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(Come("Bearer " + token_ + "x"), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(Come("Bearer tfl_"), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(Come(absl::StrCat("Bearer tfl_", std::string(1 << 20, 'x'))),
              StatusIs(Code::kUnauthenticated));
}

TEST_F(LinkAuthenticatorTest, PassesOtherTokensToTheNextAuthenticator) {
  EXPECT_EQ(Come("Bearer eyJhbGciOi")->principal->name, "ann");
  EXPECT_EQ(links_.Authenticate({})->principal->name, "ann");
  const std::string header = "Bearer " + token_;
  EXPECT_EQ(links_.Authenticate({.authorization = {header, header}})->principal->name, "ann")
      << "who sends two is not taken for a link";
}

}  // namespace
}  // namespace tissueform::testing
