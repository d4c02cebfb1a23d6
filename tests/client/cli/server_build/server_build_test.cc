// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "client/cli/session/server_process.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"
#include "tissueform/v1/plan_build_service.grpc.pb.h"

// `plan build --server` with the server's own program.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::Not;

constexpr std::chrono::seconds kPatience{30};
constexpr char kRawCt[] = R"("ct": {"hu_offset": -1024, "axes": "RPI"}, )";
constexpr char kBssro[] = R"({"name": "mandible", "osteotomy": "bssro",
                              "pose": {"translation_mm": [0, -4, 0]}})";
// Above the lower face, as 3D Slicer saves a plane by three points.
constexpr char kPlane[] =
    R"({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm",
        "controlPoints": [{"position": [0, 0, -50]}, {"position": [9, 0, -50]},
                          {"position": [0, 9, -50]}]}]})";
// A label map in a NRRD of one voxel, far from the CT.
constexpr char kFarLabels[] =
    "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: 1 1 1\n"
    "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (9000,0,0)\nencoding: ascii\n"
    "Segment0_Name:=mandible\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\n1\n";

// The lower face alone, so coarse that it takes seconds.
std::string Recipe(const std::string& ct, const std::string& above, const std::string& segment) {
  return absl::StrCat(R"({"format": "tissueform-recipe", "version": 6, )", ct,
                      R"("spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
      "region_of_interest": {"above": )",
                      above, R"(, "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
      "segments": [)",
                      segment, "]}");
}
constexpr char kAbove[] = R"({"point_mm": [0, 0, -50], "normal": [0, 0, -1]})";

class ServerBuildTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    StartServer({});
    Write("recipe.json", Recipe(kRawCt, kAbove, kBssro));
  }

  void TearDown() override {
    server_.reset();
    CliTest::TearDown();
  }

  void StartServer(const std::vector<std::string>& further) {
    server_.reset();
    // It finds no Xvfb, and leaves out the pictures, which take longest.
    const ScopedEnvironment no_path("PATH", "");
    const ScopedEnvironment no_display("DISPLAY", nullptr);
    std::vector<std::string> words = {"--data-dir", Path("data"),  "--port",
                                      "0",          "--log-level", "warn"};
    words.insert(words.end(), further.begin(), further.end());
    ASSERT_OK_AND_ASSIGN(server_,
                         ServerProcess::Start(ProgramPath("tissueform-server"), words, kPatience));
  }
  std::vector<std::string> Words(const std::string& ct,
                                 const std::vector<std::string>& further) const {
    std::vector<std::string> words = {"plan", "build", "--ct", ct, "--recipe", "recipe.json"};
    words.insert(words.end(), further.begin(), further.end());
    return words;
  }
  std::vector<std::string> ServerWords(const std::vector<std::string>& further = {}) const {
    std::vector<std::string> words = {"--server", server_->address(), "--out", "head"};
    words.insert(words.end(), further.begin(), further.end());
    return Words(TestDataPath("ct/headsq/headsq_quarter.nhdr"), words);
  }
  // Builds the same plan here and on the server.
  void ExpectTheSamePlan(const std::string& ct,
                         const std::vector<std::string>& further = {}) const {
    std::vector<std::string> here = {"--out", "here", "--no-pictures", "--accept-defects"};
    std::vector<std::string> there = {"--out", "there", "--server", server_->address(),
                                      "--accept-defects"};
    here.insert(here.end(), further.begin(), further.end());
    there.insert(there.end(), further.begin(), further.end());
    ASSERT_THAT(Run(Words(ct, here)), Succeeds());
    const ProcessResult built = Run(Words(ct, there));
    ASSERT_THAT(built, Succeeds());
    EXPECT_THAT(built.out, AllOf(HasSubstr("plan    there/plan.json: "),
                                 HasSubstr("the plan in there is NOT ready"),
                                 MatchesRegex("(.|\n)*\ncase    cases/[0-9a-f]{64}\n")));
    for (const char* file : {"plan.json", "head.vtu", "viewer.glb", "segments/mandible.stl"}) {
      EXPECT_EQ(Read(absl::StrCat("here/", file)), Read(absl::StrCat("there/", file))) << file;
    }
    EXPECT_TRUE(fs::exists(folder_ / "there/report.html"));
    EXPECT_FALSE(fs::exists(folder_ / "there/inputs"));
  }
  // Whether a file of the server holds the text.
  bool ServerHolds(const std::string& text) const {
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "data")) {
      if (absl::StrContains(entry.path().filename().string(), text)) return true;
      if (entry.is_regular_file() && absl::StrContains(BytesOfFile(entry.path()), text))
        return true;
    }
    return false;
  }
  std::vector<v1::PlanBuild> Builds() const {
    const auto stub = v1::PlanBuildService::NewStub(
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::ListPlanBuildsResponse response;
    EXPECT_TRUE(stub->ListPlanBuilds(&context, {}, &response).ok());
    return {response.builds().begin(), response.builds().end()};
  }
  // The exit code after a signal, sent when the program has written so many lines to stderr.
  int ExitCodeAfterSignal(const std::vector<std::string>& words, int lines,
                          int signal_number) const;

  std::unique_ptr<ServerProcess> server_;
};

int ServerBuildTest::ExitCodeAfterSignal(const std::vector<std::string>& words, int lines,
                                         int signal_number) const {
  const std::string program = ProgramPath("tissueform");
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  argv.reserve(words.size() + 2);
  for (const std::string& argument : words) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::array<int, 2> ends{};
  EXPECT_EQ(pipe(ends.data()), 0);
  const pid_t child = fork();
  if (child == 0) {
    std::signal(signal_number, SIG_DFL);
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    close(ends[1]);
    if (chdir(folder_.c_str()) == 0) execv(program.c_str(), argv.data());
    _exit(127);
  }
  close(ends[1]);
  std::string printed;
  char next = 0;
  while (std::ranges::count(printed, '\n') < lines && read(ends[0], &next, 1) == 1) printed += next;
  EXPECT_THAT(printed, Not(HasSubstr("reading the plan from the server")));
  kill(child, signal_number);
  int status = 0;
  waitpid(child, &status, 0);
  close(ends[0]);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(ServerBuildTest, DicomPlanMatchesTheLocalOneAndNamesNoPatient) {
  ASSERT_EQ(std::system("/usr/bin/python3 -c 'import numpy, pydicom' 2>/dev/null"), 0)
      << "python3-pydicom is not installed";
  const std::string write = absl::StrCat(
      "/usr/bin/python3 -B -c 'import sys\nsys.path.insert(0, \"", SourcePath("deploy/pacs"),
      "\")\nimport head_series\nhead_series.write_series(\"", Path("Planted"),
      "\", name=\"Planted^Pat\", patient_id=\"PLANTED-1\", born=\"19610203\")\n'");
  ASSERT_EQ(std::system(write.c_str()), 0);
  Write("recipe.json", Recipe("", kAbove, kBssro));
  ExpectTheSamePlan("Planted");
  for (const char* text : {"Planted", "PLANTED-1", "19610203"}) {
    EXPECT_FALSE(ServerHolds(text)) << text;
  }
  EXPECT_THAT(Read("there/report.json"), Not(HasSubstr("lanted")));
}

TEST_F(ServerBuildTest, SendsTheFilesThatTheRecipeNames) {
  fs::create_directory(folder_ / "planes");
  Write("planes/above.mrk.json", kPlane);
  Write("recipe.json", Recipe(kRawCt, R"({"file": "planes/above.mrk.json"})", kBssro));
  ExpectTheSamePlan(TestDataPath("ct/headsq/headsq_quarter.nhdr"));
}

TEST_F(ServerBuildTest, SurfacesPlanMatchesTheLocalOne) {
  ASSERT_THAT(Run(Words(TestDataPath("ct/headsq/headsq_quarter.nhdr"),
                        {"--out", "head", "--no-pictures", "--accept-defects"})),
              Succeeds());
  ASSERT_THAT(Run({"plan", "export", "--slicer", "scene", "head/plan.json"}), Succeeds());
  Write("scene/surfaces.json",
        R"({"format": "tissueform-surfaces", "version": 1, "units": "mm",
            "coordinate_system": "LPS", "spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
            "skin": {"file": "face.vtp"}, "skull": {"file": "bone.ply"},
            "lower_jaw": {"file": "mandible.ply"},
            "segments": [{"name": "mandible", "osteotomy": "bssro",
                          "pose": {"translation_mm": [0, -4, 0]}}]})");
  const std::vector<std::string> words = {"plan", "build", "--surfaces", "scene/surfaces.json",
                                          "--accept-defects"};
  const auto build = [&](const std::vector<std::string>& further) {
    std::vector<std::string> all = words;
    all.insert(all.end(), further.begin(), further.end());
    return Run(all);
  };
  ASSERT_THAT(build({"--out", "here", "--no-pictures"}), Succeeds());
  ASSERT_THAT(build({"--out", "there", "--server", server_->address()}), Succeeds());
  for (const char* file : {"plan.json", "head.vtu", "viewer.glb"}) {
    EXPECT_EQ(Read(absl::StrCat("here/", file)), Read(absl::StrCat("there/", file))) << file;
  }
}

TEST_F(ServerBuildTest, FailuresAreOneLineAndLeaveNothing) {
  const auto expect = [&](const ProcessResult& result, const std::string& message) {
    EXPECT_THAT(result, FailsWith(1, AllOf(HasSubstr(message), Not(HasSubstr("Doe")))));
    EXPECT_FALSE(fs::exists(folder_ / "head"));
    EXPECT_THAT(Files(), Not(::testing::Contains(HasSubstr("partial"))));
  };
  Write("Doe_Jane.nrrd", kFarLabels);
  expect(Run(ServerWords({"--labels", "Doe_Jane.nrrd"})), "the label map does not overlap the CT");
  Write("recipe.json", Recipe(kRawCt, kAbove, R"({"name": "mandible", "osteotomy": "bssro",
      "planes": [{"point_mm": [0, 0, 900], "normal": [0, 0, 1]}]})"));
  expect(Run(ServerWords()), "misses");
  Write("recipe.json", Recipe(R"("spacing": 4, )", kAbove, kBssro));
  expect(Run(ServerWords()), "unknown key");
  Write("Doe Jane.mrk.json", kPlane);
  Write("recipe.json", Recipe(kRawCt, R"({"file": "Doe Jane.mrk.json"})", kBssro));
  expect(Run(ServerWords()), "/region_of_interest/above/file names a file that cannot be sent");
  Write("recipe.json", Recipe(kRawCt, kAbove, kBssro));
  StartServer({"--plan-builds", "0"});
  expect(Run(ServerWords()), "this server builds no plans");
  EXPECT_THAT(Run(ServerWords({"--threads", "2"})), FailsWith(2, HasSubstr("--threads")));
}

TEST_F(ServerBuildTest, SignalEndsTheBuildOnTheServer) {
  // A build of some seconds: the third line is its first stage, after reading and upload.
  Write("recipe.json", absl::StrReplaceAll(Recipe(kRawCt, kAbove, kBssro),
                                           {{R"("spacing_mm": 4)", R"("spacing_mm": 2)"}}));
  for (const auto& [signal_number, lines] : {std::pair(SIGINT, 1), std::pair(SIGTERM, 3)}) {
    EXPECT_EQ(ExitCodeAfterSignal(ServerWords(), lines, signal_number), 128 + signal_number);
    EXPECT_THAT(Files(), ElementsAre("data", "recipe.json")) << lines;
  }
  const auto give_up = std::chrono::steady_clock::now() + kPatience;
  std::vector<v1::PlanBuild> builds = Builds();
  while (builds.size() == 1 && builds[0].state() < v1::PLAN_BUILD_STATE_SUCCEEDED &&
         std::chrono::steady_clock::now() < give_up) {
    usleep(50'000);
    builds = Builds();
  }
  ASSERT_EQ(builds.size(), 1U);
  EXPECT_EQ(builds[0].state(), v1::PLAN_BUILD_STATE_CANCELLED);
}

}  // namespace
}  // namespace tissueform::testing
