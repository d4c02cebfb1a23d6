// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/server_connection.h"

#include <filesystem>

#include "gtest/gtest.h"

#include "tests/testing/scoped_environment.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

class ServerConnectionTest : public ::testing::Test {
 protected:
  ServerConnectionTest() {
    std::filesystem::create_directories(folder_ / "tissueform");
    WriteTestFile(token_, "a.b.c");
  }
  ~ServerConnectionTest() override { std::filesystem::remove_all(folder_); }

  // What the options of a command make of these words.
  static ServerConnection Parse(const std::vector<const char*>& words) {
    CLI::App app("test");
    ServerConnection server;
    AddServerOption(&app, &server);
    app.parse(static_cast<int>(words.size()), words.data());
    return server;
  }

  const std::filesystem::path folder_ = EmptyTestFolder("connection");
  const std::string token_ = folder_ / "tissueform" / "token";
  const ScopedEnvironment configuration_{"XDG_CONFIG_HOME", folder_.c_str()};
};

TEST_F(ServerConnectionTest, UsesTheTokenOfTheLogin) {
  EXPECT_EQ(ResolveConnection({.address = "localhost:1"}).token_file, token_);
  EXPECT_EQ(ResolveConnection({.address = "a.example:1", .options = {.tls = true}}).token_file,
            token_);
  EXPECT_EQ(
      ResolveConnection({.address = "localhost:1", .options = {.token_file = "b"}}).token_file,
      "b");
}

TEST_F(ServerConnectionTest, DoesNotSendTheLoginTokenUnencrypted) {
  EXPECT_EQ(ResolveConnection({.address = "a.example:1", .options = {.insecure = true}}).token_file,
            "");
}

TEST_F(ServerConnectionTest, HasNoTokenWithoutALogin) {
  std::filesystem::remove(token_);
  EXPECT_EQ(ResolveConnection({.address = "localhost:1"}).token_file, "");
}

TEST_F(ServerConnectionTest, TheEnvironmentNamesFilesAndOptionsWin) {
  const ScopedEnvironment authority("TISSUEFORM_TLS_CA", "ca.pem");
  const ScopedEnvironment token("TISSUEFORM_TOKEN_FILE", "token");
  EXPECT_EQ(Parse({"test", "--server", "a:1"}).options.tls_ca, "ca.pem");
  EXPECT_EQ(Parse({"test", "--server", "a:1"}).options.token_file, "token");
  EXPECT_EQ(Parse({"test", "--server", "a:1", "--tls-ca", "other.pem"}).options.tls_ca,
            "other.pem");
}

TEST_F(ServerConnectionTest, ACertificateNeedsItsKey) {
  EXPECT_THROW(Parse({"test", "--server", "a:1", "--tls-cert", "a"}), CLI::ParseError);
  EXPECT_THROW(Parse({"test", "--server", "a:1", "--tls-key", "a"}), CLI::ParseError);
  EXPECT_NO_THROW(Parse({"test", "--server", "a:1", "--tls-key", "a", "--tls-cert", "b"}));
}

}  // namespace
}  // namespace tissueform::testing
