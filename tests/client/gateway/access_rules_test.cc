// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/access_rules.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

HttpHead Asked(const std::string& host) {
  return {.method = "GET", .target = "/", .fields = {{"host", host}}};
}

HttpHead AskedFrom(const std::string& origin, const std::string& host = "localhost:8080") {
  HttpHead head = Asked(host);
  head.fields.emplace_back("origin", origin);
  return head;
}

class AccessRulesTest : public ::testing::Test {
 protected:
  const AccessRules rules_{"192.0.2.7", {"planner.example.org"}, {"https://viewer.example.org"}};
};

TEST_F(AccessRulesTest, TheListenAddressLoopbackAndAllowedNamesAreHosts) {
  for (const char* host : {"192.0.2.7:8080", "localhost", "LOCALHOST:1", "127.0.0.1:8080",
                           "[::1]:8080", "planner.example.org", "Planner.Example.Org:443"}) {
    EXPECT_TRUE(rules_.AllowsHost(Asked(host))) << host;
  }
}

TEST_F(AccessRulesTest, RefusesOtherHostNames) {
  for (const char* host : {"evil.example", "localhost.evil.example", "", "[::1", "::1",
                           "evil.example:planner.example.org", "192.0.2.70"}) {
    EXPECT_FALSE(rules_.AllowsHost(Asked(host))) << host;
  }
}

TEST_F(AccessRulesTest, RequiresExactlyOneHostHeader) {
  HttpHead head = Asked("localhost");
  head.fields.emplace_back("host", "localhost");
  EXPECT_FALSE(rules_.AllowsHost(head));
  EXPECT_FALSE(rules_.AllowsHost({.method = "GET", .target = "/"}));
}

TEST_F(AccessRulesTest, AnIpv6AddressIsListenedOnInBrackets) {
  const AccessRules rules("2001:db8::7", {}, {});
  EXPECT_TRUE(rules.AllowsHost(Asked("[2001:DB8::7]:8080")));
}

TEST_F(AccessRulesTest, PagesOfTheSameHostAndAllowedOnesMayAsk) {
  EXPECT_TRUE(rules_.AllowsOrigin(Asked("localhost:8080")));
  EXPECT_TRUE(rules_.AllowsOrigin(AskedFrom("http://localhost:8080")));
  EXPECT_TRUE(rules_.AllowsOrigin(AskedFrom("https://planner.example.org", "planner.example.org")));
  EXPECT_TRUE(rules_.AllowsOrigin(AskedFrom("https://viewer.example.org")));
}

TEST_F(AccessRulesTest, PagesFromElsewhereMayNot) {
  for (const char* origin :
       {"http://evil.example", "null", "", "http://localhost:8081", "http://localhost",
        "localhost:8080", "file://localhost:8080", "http://viewer.example.org",
        "https://viewer.example.org.evil.example"}) {
    EXPECT_FALSE(rules_.AllowsOrigin(AskedFrom(origin))) << origin;
  }
  HttpHead twice = AskedFrom("http://localhost:8080");
  twice.fields.emplace_back("origin", "http://localhost:8080");
  EXPECT_FALSE(rules_.AllowsOrigin(twice));
}

TEST_F(AccessRulesTest, OnlyAllowedForeignOriginsAreForeign) {
  EXPECT_TRUE(rules_.IsForeignOrigin("https://viewer.example.org"));
  EXPECT_FALSE(rules_.IsForeignOrigin("http://localhost:8080"));
}

}  // namespace
}  // namespace tissueform
