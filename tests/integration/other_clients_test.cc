// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/test_paths.h"

// The real server, asked by clients that are not ours and know nothing but what it says itself.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kModulesMissing = 77;
constexpr char kHowToGetModules[] =
    "python3-grpcio, python3-protobuf or python3-vtk9 is missing: deploy/packages.txt lists them";

class OtherClientsTest : public ServedCliTest {
 protected:
  // Exit code; what it said is in out.txt.
  int Run(const std::string& command) const {
    return WEXITSTATUS(std::system(
        absl::StrCat("cd ", folder_.string(), " && ", command, " > out.txt 2>&1").c_str()));
  }

  // One of the scripts beside this file, against the server.
  int RunPython(const std::string& script) const {
    return Run(absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/"), script, " ",
                            server_->address(), " ", GRPC_PROTOS, " ", GOOGLE_RPC_PROTOS));
  }
};

TEST_F(OtherClientsTest, PythonFindsTheReasonOfEveryRpcsError) {
  const int exit_code = RunPython("call_every_rpc.py");
  const std::string out = Read("out.txt");
  if (exit_code == kModulesMissing) GTEST_SKIP() << kHowToGetModules;
  EXPECT_EQ(exit_code, 0) << out;
  EXPECT_THAT(out,
              AllOf(HasSubstr("grpc.health.v1.Health"),
                    HasSubstr("SessionService/GetSession INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("SessionService/PrepareSession INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("MeshService/UploadMesh INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("MeshService/QueryUpload INVALID_ARGUMENT INVALID_REQUEST"),
                    HasSubstr("DeformService/Deform INVALID_ARGUMENT INVALID_REQUEST")));
}

// docs/service-api.md documents this limit.
TEST_F(OtherClientsTest, ClientThatPingsTooOftenIsDisconnected) {
  EXPECT_EQ(RunPython("ping_too_often.py"), 0) << Read("out.txt");
  EXPECT_EQ(Read("out.txt"),
            "first three: ['answered', 'answered', 'answered']\n"
            "end: ENHANCE_YOUR_CALM too_many_pings\n");
}

TEST_F(OtherClientsTest, PythonGoesOnWithAnUploadAndPreparesASession) {
  const int exit_code = RunPython("send_and_prepare.py");
  const std::string out = Read("out.txt");
  if (exit_code == kModulesMissing) GTEST_SKIP() << kHowToGetModules;
  EXPECT_EQ(exit_code, 0) << out;
  EXPECT_EQ(out,
            "broken off: INVALID_ARGUMENT\n"
            "there: 5000 of 17688\n"
            "mesh: True 225 768\n"
            "progress: True in order: True\n"
            "session: True True ['top']\n");
}

TEST_F(OtherClientsTest, PythonKeepsACaseAndGetsTheSurfaceThatVtkFinds) {
  const int exit_code = RunPython("case_and_surface.py");
  const std::string out = Read("out.txt");
  if (exit_code == kModulesMissing) GTEST_SKIP() << kHowToGetModules;
  EXPECT_EQ(exit_code, 0) << out;
  EXPECT_EQ(out,
            "damaged: DATA_LOSS\n"
            "case: True head False\n"
            "case: True head True\n"
            "listed: True ''\n"
            "read: True\n"
            "part: True 1000 250000\n"
            "deleted: NOT_FOUND\n"
            "hash: True True\n"
            "counts: 162 320 euler: 2\n"
            "positions: True rising: True\n"
            "volume: 1024.0\n"
            "VTK's: True 320\n");
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
