// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_options.h"

#include <fstream>
#include <iterator>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

struct Parsed {
  GatewayOptions options;
  std::string error;
};

Parsed Parse(const std::string& arguments) {
  Parsed parsed;
  CLI::App app;
  AddGatewayOptions(app, &parsed.options);
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    parsed.error = error.what();
  }
  return parsed;
}

TEST(GatewayOptions, ItsServerHasOneAddress) {
  const Parsed parsed = Parse("--server a:1");
  EXPECT_EQ(parsed.error, "");
  EXPECT_EQ(parsed.options.server, "a:1");
  EXPECT_EQ(parsed.options.host, "127.0.0.1");
  EXPECT_EQ(parsed.options.port, 8080);
  EXPECT_EQ(Parse("--server unix:/run/a=b").options.server, "unix:/run/a=b");
  EXPECT_EQ(Parse("--server [::1]:1").options.server, "[::1]:1");
}

TEST(GatewayOptions, SuggestsHaproxyForSeveralServers) {
  for (const char* text : {"--server a:1 --server b:2", "--server a:1 unix:/b",
                           "--server left=a:1 --server right=b:1", "--server left=a:1"}) {
    const std::string error = Parse(text).error;
    EXPECT_THAT(error, HasSubstr("put HAProxy before the servers")) << text;
    EXPECT_THAT(error, HasSubstr("docs/gateway.md")) << text;
    EXPECT_EQ(error.find('\n'), std::string::npos) << text;
  }
}

TEST(GatewayOptions, RefusesAnInvalidServerAddress) {
  EXPECT_NE(Parse("").error, "");
  for (const char* text : {"a", ":1", "a:0", "a:65536", "a:b", "http://127.0.0.1:1", "a/b:1"}) {
    EXPECT_THAT(Parse(std::string("--server ") + text).error, HasSubstr("give HOST:PORT")) << text;
  }
}

TEST(GatewayOptions, AddressesToListenOnAreHostAndPort) {
  EXPECT_EQ(Parse("--server a:1 --listen localhost:0").options.port, 0);
  EXPECT_EQ(Parse("--server a:1 --listen [::1]:80").options.host, "::1");
  for (const char* text : {"localhost", ":80", "::1:80", "a:-1", "a:65536", "a:b"}) {
    EXPECT_NE(Parse(std::string("--server a:1 --listen ") + text).error, "") << text;
  }
}

TEST(GatewayOptions, LimitsAreInTheUnitsOfTheirNames) {
  const GatewayLimits limits =
      Parse(
          "--server a:1 --max-header-kib 8 --max-message-mib 2 --max-sockets 7 "
          "--stall-seconds 5")
          .options.limits;
  EXPECT_EQ(limits.header_bytes, 8U << 10);
  EXPECT_EQ(limits.message_bytes, 2U << 20);
  EXPECT_EQ(limits.sockets, 7);
  EXPECT_EQ(limits.stall_deadline, std::chrono::seconds(5));
  for (const char* text : {"--max-sockets 0", "--max-message-mib 2048", "--stall-seconds 0"}) {
    EXPECT_NE(Parse(std::string("--server a:1 ") + text).error, "") << text;
  }
}

TEST(GatewayOptions, EveryOptionIsDocumented) {
  std::ifstream file(testing::SourcePath("docs/gateway.md"));
  const std::string document(std::istreambuf_iterator<char>(file), {});
  CLI::App app;
  GatewayOptions options;
  AddGatewayOptions(app, &options);
  for (const CLI::Option* option : app.get_options()) {
    const std::string name = option->get_name();
    if (name == "--help") continue;
    EXPECT_NE(document.find("`" + name), std::string::npos) << name;
  }
}

}  // namespace
}  // namespace tissueform
