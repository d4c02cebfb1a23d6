// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "client/cli/online/server_process.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// The real server, asked by clients that are not ours and know nothing but what it says itself.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kModulesMissing = 77;

class OtherClientsTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    ASSERT_OK_AND_ASSIGN(server_,
                         ServerProcess::Start(ProgramPath("tissueform-server"),
                                              {"--in-memory", "--port", "0", "--log-level", "warn"},
                                              std::chrono::seconds(60)));
  }

  // Exit code; what it said is in out.txt.
  int Run(const std::string& command) const {
    return WEXITSTATUS(std::system(
        absl::StrCat("cd ", folder_.string(), " && ", command, " > out.txt 2>&1").c_str()));
  }

  std::unique_ptr<ServerProcess> server_;
};

TEST_F(OtherClientsTest, PythonFindsTheReasonOfEveryRpcsError) {
  const int exit_code =
      Run(absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/call_every_rpc.py"),
                       " ", server_->address(), " ", GRPC_PROTOS, " ", GOOGLE_RPC_PROTOS));
  const std::string out = Read("out.txt");
  if (exit_code == kModulesMissing) {
    GTEST_SKIP() << "python3-grpcio or python3-protobuf is missing: deploy/packages.txt lists them";
  }
  EXPECT_EQ(exit_code, 0) << out;
  EXPECT_THAT(out,
              AllOf(HasSubstr("grpc.health.v1.Health"),
                    HasSubstr("SessionService/GetSession INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("SessionService/PrepareSession INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("MeshService/UploadMesh INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("MeshService/QueryUpload INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("DeformService/Deform INVALID_ARGUMENT INVALID_REQUEST")));
}

TEST_F(OtherClientsTest, BufListsAndCallsRpcsByReflection) {
  const std::string buf = SourcePath("deploy/protocol_tools/node_modules/buf");
  if (!std::filesystem::exists(buf)) {
    GTEST_SKIP() << "buf is missing: deploy/install_protocol_tools.sh installs it";
  }
  const std::string curl = absl::StrCat(buf, " curl --protocol grpc --http2-prior-knowledge ");
  const std::string url = absl::StrCat("http://", server_->address());
  ASSERT_EQ(Run(absl::StrCat(curl, "--list-methods ", url)), 0) << Read("out.txt");
  EXPECT_THAT(Read("out.txt"), AllOf(HasSubstr("grpc.health.v1.Health/Check"),
                                     HasSubstr("tissueform.v1.DeformService/Deform"),
                                     Not(HasSubstr("tissueform.store"))));
  EXPECT_EQ(Run(absl::StrCat(curl, url, "/grpc.health.v1.Health/Check")), 0);
  EXPECT_THAT(Read("out.txt"), HasSubstr("SERVING"));
  EXPECT_NE(Run(absl::StrCat(curl, "-d '{\"name\": \"sessions/none\"}' ", url,
                             "/tissueform.v1.SessionService/GetSession")),
            0);
  EXPECT_THAT(Read("out.txt"),
              AllOf(HasSubstr("\"not_found\""), HasSubstr("google.rpc.ErrorInfo")));
}

}  // namespace
}  // namespace tissueform::testing
