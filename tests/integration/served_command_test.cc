// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <signal.h>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "client/cli/server_process.h"
#include "client/cpp/tissueform_client.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "tests/testing/status_matchers.h"

// `tissueform run` and `tissueform demo` as real programs with a real server.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience{60};
const std::string kPlan = TISSUEFORM_TEST_DATA_DIR "/plans/tongue/plan.json";

int ExitCodeOf(const std::string& command) { return WEXITSTATUS(std::system(command.c_str())); }

class ServedCommandTest : public ::testing::Test {
 protected:
  ServedCommandTest() { fs::create_directories(folder_); }
  ~ServedCommandTest() override { fs::remove_all(folder_); }

  std::string PathOf(const std::string& name) const { return (folder_ / name).string(); }

  const fs::path folder_ = fs::path(::testing::TempDir()) /
                           (std::string("tissueform_") +
                            ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(ServedCommandTest, RunEqualsDeformUpToFloat32) {
  ASSERT_OK_AND_ASSIGN(const std::unique_ptr<ServerProcess> server,
                       ServerProcess::Start(TISSUEFORM_SERVER_BINARY,
                                            {"--port", "0", "--log-level", "warn"}, kPatience));
  const std::string program = TISSUEFORM_BINARY;
  ASSERT_EQ(ExitCodeOf(program + " run " + kPlan + " --server " + server->address() + " --out " +
                       PathOf("run.vtu") + " --stats " + PathOf("run.json")),
            0);
  ASSERT_EQ(ExitCodeOf(program + " deform " + kPlan + " --out " + PathOf("deform.vtu")), 0);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile run, ReadTetMesh(PathOf("run.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile deform, ReadTetMesh(PathOf("deform.vtu")));
  ASSERT_EQ(run.mesh.num_vertices(), deform.mesh.num_vertices());
  // Coordinates are below 8 mm: float32 steps there are 4.8e-7 mm.
  EXPECT_LT((run.mesh.positions() - deform.mesh.positions()).cwiseAbs().maxCoeff(), 5e-7);
  EXPECT_TRUE(fs::exists(PathOf("run.json")));
}

TEST_F(ServedCommandTest, RunWithoutServerFailsAndWritesNothing) {
  EXPECT_EQ(ExitCodeOf(std::string(TISSUEFORM_BINARY) + " run " + kPlan +
                       " --server 127.0.0.1:1 --out " + PathOf("run.vtu") + " 2>" + PathOf("err")),
            1);
  EXPECT_FALSE(fs::exists(PathOf("run.vtu")));
}

TEST_F(ServedCommandTest, DemoLeavesItsResults) {
  ASSERT_EQ(ExitCodeOf(std::string(TISSUEFORM_BINARY) + " demo --no-browser --out " +
                       folder_.string() + " > " + PathOf("out.txt")),
            0);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(PathOf("result.vtu")));
  EXPECT_EQ(result.mesh.num_vertices(), 2238);
  EXPECT_NE(FindAttribute(result.point_data, "displacement_mm"), nullptr);
  EXPECT_GT(fs::file_size(PathOf("frames.csv")), 1000);
  std::ifstream summary(PathOf("summary.json"));
  const std::string text((std::istreambuf_iterator<char>(summary)), {});
  EXPECT_THAT(text, HasSubstr("\"frames_sent\": 180"));
}

TEST_F(ServedCommandTest, AnInterruptedDemoEndsItsServer) {
  // The shell tells its process number and becomes the demo.
  const std::string command = "echo $$; exec " + std::string(TISSUEFORM_BINARY) + " demo --out " +
                              folder_.string() + " 2>" + PathOf("err");
  FILE* demo = popen(command.c_str(), "r");
  ASSERT_NE(demo, nullptr);
  std::array<char, 512> line{};
  ASSERT_NE(std::fgets(line.data(), line.size(), demo), nullptr);
  const pid_t pid = std::atoi(line.data());
  ASSERT_GT(pid, 1);
  std::string address;
  const std::string listens = "tissueform-server listens on ";
  while (std::fgets(line.data(), line.size(), demo) != nullptr) {
    const std::string text = line.data();
    if (text.rfind(listens, 0) == 0) {
      address = text.substr(listens.size(), text.find('\n') - listens.size());
      kill(pid, SIGINT);
    }
  }
  EXPECT_EQ(WEXITSTATUS(pclose(demo)), 1);
  ASSERT_FALSE(address.empty());
  TissueformClient::Options options;
  options.connect_deadline = std::chrono::milliseconds(300);
  EXPECT_THAT(TissueformClient::Connect(address, options),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr(address)));
}

}  // namespace
}  // namespace tissueform::testing
