// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/network_address.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(NetworkAddressTest, AddressesAreWrittenInOneForm) {
  EXPECT_EQ(AddressOr("192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(AddressOr("2001:DB8:0::1"), "2001:db8::1");
}

TEST(NetworkAddressTest, RefusesInvalidAddresses) {
  for (const char* text : {"", "192.0.2", "192.0.2.1:80", "[::1]", "a name", "1.2.3.4\n",
                           "192.0.2.1, 192.0.2.2", "::ffff:::"}) {
    EXPECT_EQ(AddressOr(text), "") << text;
  }
  EXPECT_EQ(AddressOr(std::string(100'000, '1')), "");
}

TEST(NetworkAddressTest, OnlyThisMachinesOwnAddressesAreLoopback) {
  for (const char* host : {"127.0.0.1", "127.8.9.10", "::1", "localhost"}) {
    EXPECT_TRUE(IsLoopback(host)) << host;
  }
  for (const char* host : {"0.0.0.0", "::", "192.0.2.1", "no-such-host.invalid"}) {
    EXPECT_FALSE(IsLoopback(host)) << host;
  }
}

}  // namespace
}  // namespace tissueform
