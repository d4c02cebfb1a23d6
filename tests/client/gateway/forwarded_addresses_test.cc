// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/forwarded_addresses.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

HttpHead From(const std::string& peer, const std::vector<std::string>& forwarded) {
  HttpHead head = {.method = "GET", .target = "/", .peer = peer};
  for (const std::string& value : forwarded) head.fields.emplace_back("x-forwarded-for", value);
  return head;
}

const ForwardedAddresses kBehindTwo({"192.0.2.1", "2001:db8::1"});

TEST(ForwardedAddressesTest, IgnoresTheHeaderWithoutATrustedProxy) {
  EXPECT_EQ(ForwardedAddresses().Of(From("192.0.2.1", {"198.51.100.7"})), "192.0.2.1");
}

TEST(ForwardedAddressesTest, IgnoresTheHeaderOfAnUntrustedPeer) {
  EXPECT_EQ(kBehindTwo.Of(From("192.0.2.9", {"198.51.100.7"})), "192.0.2.9");
}

TEST(ForwardedAddressesTest, UsesOnlyTheAddressAddedByTheTrustedProxy) {
  EXPECT_EQ(kBehindTwo.Of(From("192.0.2.1", {"10.0.0.1, 198.51.100.7"})), "198.51.100.7");
  EXPECT_EQ(kBehindTwo.Of(From("192.0.2.1", {"10.0.0.1", "198.51.100.7"})), "198.51.100.7");
}

TEST(ForwardedAddressesTest, TrustedProxiesMayStandInARow) {
  EXPECT_EQ(kBehindTwo.Of(From("192.0.2.1", {"10.0.0.1,198.51.100.7 , 2001:DB8::1"})),
            "198.51.100.7");
}

TEST(ForwardedAddressesTest, InvalidAddressEndsTheChain) {
  for (const char* text : {"", "unknown", "198.51.100.7:80", "198.51.100.7, "}) {
    EXPECT_EQ(kBehindTwo.Of(From("192.0.2.1", {text})), "192.0.2.1") << text;
  }
}

TEST(ForwardedAddressesTest, ProxiesAreAddresses) {
  EXPECT_TRUE(ForwardedAddresses::CheckProxies({"192.0.2.1", "::1"}).ok());
  EXPECT_FALSE(ForwardedAddresses::CheckProxies({"192.0.2.1", "proxy.example.org"}).ok());
}

}  // namespace
}  // namespace tissueform
