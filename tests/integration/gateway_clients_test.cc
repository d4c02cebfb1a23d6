// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "tests/integration/served_cli_test.h"
#include "tests/testing/test_paths.h"

// The real gateway before the real server, asked by client libraries of other projects.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kMissing = 77;
// What gateway_calls.py says when all is well.
constexpr char kCalls[] =
    "mesh: 225 768 0 1000\n"
    "progress: True 0 1000\n"
    "drag: 50 in place: True 0 1000\n"
    "watch: True\n"
    "text: 3 1003\n"
    "huge: 3 1009\n"
    "unknown: 12 1000\n";

class GatewayClientsTest : public ServedCliTest {
 protected:
  void SetUp() override {
    ServedCliTest::SetUp();
    std::ofstream(folder_ / "index.html") << "<!doctype html>";
    ASSERT_OK_AND_ASSIGN(
        gateway_, ServerProcess::Start(ProgramPath("tissueform-gateway"),
                                       {"--server", server_->address(), "--listen", "127.0.0.1:0",
                                        "--web", folder_.string(), "--log-level", "warn"},
                                       std::chrono::seconds(60)));
  }

  const std::string& url() const { return gateway_->address(); }

  // Exit code; what it said is in out.txt.
  int RunCommand(const std::string& command) const {
    return WEXITSTATUS(std::system(
        absl::StrCat("cd ", folder_.string(), " && ", command, " > out.txt 2>&1").c_str()));
  }
  // One of the scripts beside this file, against the gateway.
  int RunScript(const std::string& script, const std::string& arguments = "") const {
    return RunCommand(absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/"), script,
                                   " ", url(), " ", SourcePath("proto"), " ", arguments));
  }

  std::unique_ptr<ServerProcess> gateway_;
};

TEST_F(GatewayClientsTest, PythonDragsOverWebSockets) {
  const int exit_code = RunScript("gateway_calls.py");
  if (exit_code == kMissing) GTEST_SKIP() << "python3-websockets is missing: deploy/packages.txt";
  EXPECT_EQ(exit_code, 0);
  EXPECT_EQ(Read("out.txt"), kCalls);
}

TEST_F(GatewayClientsTest, PythonDragsThroughHaproxyWithTls) {
  const int exit_code = RunScript("behind_haproxy.py", SourcePath("deploy/haproxy/planner.cfg"));
  if (exit_code == kMissing) GTEST_SKIP() << "haproxy is missing: deploy/packages.txt";
  EXPECT_EQ(exit_code, 0);
  EXPECT_THAT(Read("out.txt"), AllOf(HasSubstr("tls: True True\n"), HasSubstr(kCalls)));
}

TEST_F(GatewayClientsTest, BufCallsOverGrpcWeb) {
  const std::string buf = SourcePath("deploy/protocol_tools/node_modules/buf");
  if (!std::filesystem::exists(buf)) {
    GTEST_SKIP() << "buf is missing: deploy/install_protocol_tools.sh installs it";
  }
  const std::string curl =
      absl::StrCat(buf, " curl --protocol grpcweb --schema ", SourcePath("proto"), " ");
  const std::string service = absl::StrCat(url(), "/tissueform.v1.");
  EXPECT_EQ(RunCommand(absl::StrCat(curl, service, "ServerInfoService/GetServerInfo")), 0);
  EXPECT_THAT(Read("out.txt"), HasSubstr("\"apiVersion\": \"tissueform.v1\""));
  EXPECT_NE(RunCommand(absl::StrCat(curl, "-d '{\"name\": \"predictions/none\"}' ", service,
                                    "PredictionService/ReadPositions")),
            0);
  EXPECT_THAT(Read("out.txt"),
              AllOf(HasSubstr("\"not_found\""), HasSubstr("google.rpc.ErrorInfo")));
  EXPECT_NE(RunCommand(absl::StrCat(curl, "-d '{\"session\": \"sessions/none\"}' ", service,
                                    "DeformService/Watch")),
            0);
  EXPECT_THAT(Read("out.txt"), AllOf(HasSubstr("\"unimplemented\""), HasSubstr("WebSocket")));
}

TEST_F(GatewayClientsTest, EndsWellBySignal) {
  gateway_->Terminate();
  EXPECT_EQ(gateway_->WaitForExit(std::chrono::seconds(60)), 0);
}

}  // namespace
}  // namespace tissueform::testing
