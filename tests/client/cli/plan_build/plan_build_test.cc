// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "nlohmann/json.hpp"
#include <sys/wait.h>

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/planning/rendering/virtual_display.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kRawCt[] = R"("ct": {"hu_offset": -1024, "axes": "RPI"}, )";
constexpr char kBssro[] = R"({"name": "mandible", "osteotomy": "bssro",
                              "pose": {"translation_mm": [0, -4, 0]}})";

// The lower face alone, so coarse that it takes seconds.
std::string Recipe(const std::string& ct = kRawCt, const std::string& segment = kBssro) {
  return absl::StrCat(R"({"format": "tissueform-recipe", "version": 1, )", ct,
                      R"("spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
      "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]},
                             "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
      "segments": [)",
                      segment, "]}");
}

class PlanBuildTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    Write("recipe.json", Recipe());
  }

  ProcessResult Build(std::vector<std::string> further = {}) const {
    return BuildFrom(TestDataPath("ct/headsq/headsq_quarter.nhdr"), std::move(further));
  }
  ProcessResult BuildFrom(const std::string& ct, std::vector<std::string> further = {}) const {
    std::vector<std::string> words = {"plan", "build", "--ct", ct, "--recipe", "recipe.json"};
    words.insert(words.end(), further.begin(), further.end());
    if (std::find(words.begin(), words.end(), "--out") == words.end()) {
      words.insert(words.end(), {"--out", "head", "--no-pictures"});
    }
    return Run(words);
  }
  // The bundled CT in files that are named as no file should be.
  void WriteNamedCt() const {
    const std::filesystem::path data = TestDataPath("ct/headsq");
    std::filesystem::copy_file(data / "headsq_quarter.raw.gz", folder_ / "Doe_Jane.raw.gz");
    std::filesystem::copy_file(data / "headsq_quarter.nhdr", folder_ / "old.nhdr");
    Write("Doe_Jane.nhdr", absl::StrReplaceAll(Read("old.nhdr"), {{"headsq_quarter", "Doe_Jane"}}));
    std::filesystem::remove(folder_ / "old.nhdr");
  }
  // Packs files of the test's folder.
  void Zip(const std::string& name, const std::vector<std::string>& files) const {
    std::string command =
        absl::StrCat("cd '", folder_.string(), "' && python3 -m zipfile -c ", name);
    for (const std::string& file : files) absl::StrAppend(&command, " '", file, "'");
    ASSERT_EQ(std::system(command.c_str()), 0);
  }
  // All files of a folder, below it too, by their paths in it.
  std::vector<std::string> AllFiles(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / folder)) {
      if (!entry.is_regular_file()) continue;
      names.push_back(std::filesystem::relative(entry.path(), folder_ / folder).string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
};

// A label map in a NRRD of one voxel, far from the CT.
constexpr char kFarLabels[] =
    "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: 1 1 1\n"
    "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (9000,0,0)\nencoding: ascii\n"
    "Segment0_Name:=mandible\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\n1\n";

TEST_F(PlanBuildTest, ZipOfACtGivesThePlanOfTheCt) {
  WriteNamedCt();
  Zip("ct.zip", {"Doe_Jane.nhdr", "Doe_Jane.raw.gz"});
  const ProcessResult zipped = BuildFrom("ct.zip", {"--accept-defects"});
  ASSERT_EQ(zipped.exit_code, 0) << zipped.err;
  std::filesystem::rename(folder_ / "head", folder_ / "from_zip");
  ASSERT_EQ(Build({"--accept-defects"}).exit_code, 0);
  EXPECT_EQ(AllFiles("from_zip"), AllFiles("head"));
  for (const char* file : {"plan.json", "head.vtu", "viewer.glb"}) {
    EXPECT_EQ(Read(absl::StrCat("from_zip/", file)), Read(absl::StrCat("head/", file))) << file;
  }
}

TEST_F(PlanBuildTest, RefusesAZipOfTwoVolumesWithoutNamingThePatient) {
  WriteNamedCt();
  std::filesystem::create_directory(folder_ / "Doe");
  std::filesystem::copy(folder_ / "Doe_Jane.nhdr", folder_ / "Doe/other.nhdr");
  Zip("ct.zip", {"Doe_Jane.nhdr", "Doe_Jane.raw.gz", "Doe/"});
  const ProcessResult result = BuildFrom("ct.zip");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("it holds 2 volumes: file 1 (.nhdr"));
  EXPECT_THAT(result.err, Not(HasSubstr("Doe")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "head"));
  Write("ct.zip", "not a zip");
  EXPECT_THAT(BuildFrom("ct.zip").err, HasSubstr("it is damaged or not complete"));
  EXPECT_THAT(Files(), Each(Not(HasSubstr("partial"))));
}

TEST_F(PlanBuildTest, LabelsThatDoNotFitAreRefusedInOneLine) {
  Write("Doe_Jane.nrrd", kFarLabels);
  const auto expect = [](const ProcessResult& result) {
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, AllOf(HasSubstr("cannot use the label map: the label map does not "
                                            "overlap the CT"),
                                  Not(HasSubstr("Doe"))));
  };
  expect(Build({"--labels", "Doe_Jane.nrrd"}));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "head"));
  expect(Run({"plan", "check", "--ct", TestDataPath("ct/headsq/headsq_quarter.nhdr"), "--labels",
              "Doe_Jane.nrrd", "--recipe", "recipe.json"}));
}

TEST_F(PlanBuildTest, PlanCheckNeedsAPlanOrLabelsWithTheirCt) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"plan", "check"}, {"plan", "check", "--labels", "a.nrrd"}}) {
    EXPECT_EQ(Run(words).exit_code, 2);
  }
}

TEST_F(PlanBuildTest, PlanIsBuiltReportedAndCanBeRun) {
  if (const auto display = VirtualDisplay::Open(); absl::IsNotFound(display.status())) {
    GTEST_SKIP() << display.status();
  }
  const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");  // as in ExperimentsTest
  WriteNamedCt();
  const ProcessResult result =
      BuildFrom("Doe_Jane.nhdr", {"--out", "head", "--stats", "stats.json", "--accept-defects"});
  ASSERT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("head/plan.json"), HasSubstr("handle  mandible")));

  EXPECT_THAT(
      AllFiles("head"),
      ElementsAre("head.vtu", "pictures/bone.png", "pictures/constraints.png",
                  "pictures/coverage.png", "pictures/mouth.png", "pictures/quality.png",
                  "pictures/skin.png", "pictures/slices.png", "pictures/tets.png", "plan.json",
                  "report.html", "report.json", "segments/mandible.stl", "viewer.glb"));
  const auto report = nlohmann::json::parse(Read("head/report.json"));
  EXPECT_EQ(report["format"], "tissueform-plan-report");
  EXPECT_EQ(report["input"]["size_voxels"], nlohmann::json({64, 64, 93}));
  EXPECT_EQ(report["recipe"]["spacing_mm"], 4);
  EXPECT_EQ(report["recipe"]["poisson_ratio"], 0.45);  // which the recipe leaves out
  EXPECT_EQ(report["quality"].size(), 12U);
  EXPECT_EQ(report["mouth_line"]["found"], true);
  for (const auto& picture : report["pictures"]) {
    const std::string file = picture["file"];
    EXPECT_THAT(Read("head/" + file), StartsWith("\x89PNG"));
    EXPECT_THAT(Read("head/report.html"), HasSubstr("<img src=\"" + file + "\" alt=\""));
  }
  for (const std::string& file : AllFiles("head")) {
    for (const std::string& name : {std::string("Doe_Jane"), folder_.string()}) {
      EXPECT_EQ(Read("head/" + file).find(name), std::string::npos) << file;
    }
  }
  EXPECT_EQ(nlohmann::json::parse(Read("stats.json"))["stages"][0]["stage"], "reading the CT");

  EXPECT_THAT(Run({"plan", "check", "head/plan.json"}), Succeeds());
  EXPECT_THAT(Run({"deform", "head/plan.json", "--out", "after.vtu"}), Succeeds());
  EXPECT_THAT(Files(), Each(Not(HasSubstr("partial"))));
}

TEST_F(PlanBuildTest, SameInputGivesTheSameBytesWithAnyNumberOfThreads) {
  ASSERT_THAT(Build({"--out", "one", "--no-pictures", "--accept-defects", "--threads", "1"}),
              Succeeds());
  std::filesystem::create_directory(folder_ / "two");  // an empty folder is filled, too
  ASSERT_THAT(Build({"--out", "two", "--no-pictures", "--accept-defects", "--threads", "2"}),
              Succeeds());
  ASSERT_THAT(AllFiles("one"), ElementsAre("head.vtu", "plan.json", "report.html", "report.json",
                                           "segments/mandible.stl", "viewer.glb"));
  EXPECT_EQ(AllFiles("one"), AllFiles("two"));
  for (const std::string& file : AllFiles("one")) {
    EXPECT_TRUE(Read("one/" + file) == Read("two/" + file)) << file;
  }
}

// Edges of 8 mm cut off lips and chin.
TEST_F(PlanBuildTest, PlanThatMissesARequirementIsKeptAndNotReady) {
  const ProcessResult refused = Build();
  EXPECT_THAT(refused,
              FailsWith(1, AllOf(HasSubstr("the plan in head is not ready"),
                                 HasSubstr("% in the unnamed skin"), HasSubstr("in the chin"),
                                 HasSubstr("--accept-defects"))));
  EXPECT_THAT(refused.out, AllOf(HasSubstr("NOT ready"), Not(HasSubstr("plan is ready"))));
  EXPECT_EQ(nlohmann::json::parse(Read("head/report.json"))["ready"], false);
  EXPECT_THAT(AllFiles("head"), ElementsAre("head.vtu", "plan.json", "report.html", "report.json",
                                            "segments/mandible.stl", "viewer.glb"));

  const ProcessResult accepted = Build({"--out", "accepted", "--no-pictures", "--accept-defects"});
  EXPECT_THAT(accepted, Succeeds());
  EXPECT_THAT(accepted.out, AllOf(HasSubstr("NOT ready"), HasSubstr("mind    The mesh misses"),
                                  HasSubstr("% of the upper lip")));
  EXPECT_TRUE(Read("head/report.json") == Read("accepted/report.json"));
}

// What the program wrote to stderr until it said `word`; then it is sent the signal.
int ExitCodeAfterSignal(const std::vector<std::string>& arguments, const std::string& folder,
                        const std::string& word, int signal_number) {
  const std::string program = ProgramPath("tissueform");
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::array<int, 2> ends{};
  EXPECT_EQ(pipe(ends.data()), 0);
  const pid_t child = fork();
  if (child == 0) {
    std::signal(signal_number, SIG_DFL);
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    close(ends[1]);
    if (chdir(folder.c_str()) == 0) execv(program.c_str(), argv.data());
    _exit(127);
  }
  close(ends[1]);
  std::string printed;
  char next = 0;
  while (printed.find(word) == std::string::npos && read(ends[0], &next, 1) == 1) printed += next;
  EXPECT_THAT(printed, HasSubstr(word));
  kill(child, signal_number);
  int status = 0;
  waitpid(child, &status, 0);
  close(ends[0]);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(PlanBuildTest, SignalLeavesNothing) {
  const std::vector<std::string> words = {
      "plan",     "build",       "--ct",         TestDataPath("ct/headsq/headsq_quarter.nhdr"),
      "--recipe", "recipe.json", "--out",        "head",
      "--stats",  "stats.json",  "--no-pictures"};
  for (const auto& [signal_number, stage] :
       {std::pair(SIGINT, "reading the CT"), std::pair(SIGINT, "remeshing"),
        std::pair(SIGHUP, "remeshing"), std::pair(SIGTERM, "filling the surface")}) {
    EXPECT_EQ(ExitCodeAfterSignal(words, folder_.string(), stage, signal_number),
              128 + signal_number);
    EXPECT_THAT(Files(), ElementsAre("recipe.json")) << stage;
  }
}

TEST_F(PlanBuildTest, FolderThatCannotBeFilledIsRefusedBeforeTheWork) {
  std::filesystem::create_directory(folder_ / "taken");
  Write("taken/file", "");
  EXPECT_THAT(Build({"--out", "taken"}), FailsWith(1, HasSubstr("not an empty folder")));
  EXPECT_THAT(Build({"--out", "recipe.json"}), FailsWith(1, HasSubstr("not an empty folder")));
  EXPECT_THAT(Build({"--out", "no/head"}), FailsWith(1, HasSubstr("make it first")));
  EXPECT_THAT(Build({"--out", "head", "--stats", "head/stats.json"}),
              FailsWith(1, HasSubstr("--stats head/stats.json")));
  EXPECT_THAT(Files(), ElementsAre("recipe.json", "taken"));
  EXPECT_EQ(AllFiles("taken").size(), 1U);
}

TEST_F(PlanBuildTest, WrongUseIsOneLine) {
  EXPECT_THAT(Run({"plan", "build"}), FailsWith(2, HasSubstr("tissueform plan build --help")));
  EXPECT_THAT(Build({"--out", "head", "--threads", "many"}), FailsWith(2, HasSubstr("many")));
  EXPECT_THAT(Run({"plan", "build", "--out", "head", "--surfaces", "a.json", "--ct", "b.nrrd",
                   "--recipe", "recipe.json"}),
              FailsWith(2, HasSubstr("--surfaces")));
  EXPECT_THAT(Run({"plan", "build", "--out", "head", "--ct", "b.nrrd"}),
              FailsWith(2, HasSubstr("--recipe")));
  EXPECT_THAT(Run({"plan", "build", "--out", "head", "--no-pictures", "--surfaces", "a.json"}),
              FailsWith(1, HasSubstr("a.json")));
  const ProcessResult help = Run({"plan", "build", "--help"});
  EXPECT_THAT(help, Succeeds());
  EXPECT_THAT(help.out, AllOf(HasSubstr("\"osteotomy\": \"bssro\""), HasSubstr("Examples")));
  EXPECT_THAT(Run({"plan", "--help"}).out, AllOf(HasSubstr("check"), HasSubstr("build")));
}

TEST_F(PlanBuildTest, UnusableRecipeIsRefused) {
  EXPECT_THAT(Run({"plan", "build", "--ct", "x", "--recipe", "none.json", "--out", "head"}),
              FailsWith(1, HasSubstr("none.json does not exist")));
  Write("recipe.json", Recipe(R"("spacing": 4, )"));
  EXPECT_THAT(Build(), FailsWith(1, AllOf(HasSubstr("unknown key"), HasSubstr("spacing"))));
  Write("recipe.json", Recipe(kRawCt, R"({"name": "mandible", "osteotomy": "bssro",
      "planes": [{"point_mm": [0, 0, 900], "normal": [0, 0, 1]}]})"));
  EXPECT_THAT(Build(), FailsWith(1, HasSubstr("misses")));
  EXPECT_THAT(Files(), ElementsAre("recipe.json"));
}

TEST_F(PlanBuildTest, UnusableCtIsRefused) {
  std::filesystem::create_directory(folder_ / "empty");
  EXPECT_THAT(BuildFrom("no_such_ct"), FailsWith(1, HasSubstr("no such file or folder")));
  EXPECT_THAT(BuildFrom("empty"), FailsWith(1, HasSubstr("the folder is empty")));
  EXPECT_THAT(BuildFrom("recipe.json"), FailsWith(1, HasSubstr("not a DICOM file")));
  Write("recipe.json", Recipe(R"("ct": {"axes": "RPI"}, )"));
  EXPECT_THAT(Build(), FailsWith(1, HasSubstr("\"hu_offset\": -1024")));
  EXPECT_THAT(Files(), ElementsAre("empty", "recipe.json"));
}

// Writes the bundled head by pydicom: soft (series 2, study 2.25.1) and bone (series 1), by study.
std::string SoftAndBone(const std::string& folder, const std::string& study_of_bone) {
  return absl::StrCat("/usr/bin/python3 -B -c '\n",
                      "import os, sys\n"
                      "sys.path.insert(0, \"",
                      SourcePath("deploy/pacs"),
                      "\")\n"
                      "import head_series\n"
                      "def bone(image, index):\n"
                      "  image.SeriesNumber, image.ConvolutionKernel = 1, \"H70h\"\n"
                      "def write(name, **words):\n"
                      "  head_series.write_series(name, name=\"Planted^Pat\", **words)\n"
                      "  for file in os.listdir(name):\n"
                      "    os.rename(name + \"/\" + file, \"",
                      folder,
                      "/\" + name[-4:] + file)\n"
                      "write(\"",
                      folder, "/../soft\", study=\"2.25.1\")\nwrite(\"", folder,
                      "/../bone\", study=\"", study_of_bone, "\", alter=bone)\n'");
}

TEST_F(PlanBuildTest, SoftSeriesOfAStudyIsChosenAndStudiesAreNotMixed) {
  ASSERT_EQ(std::system("/usr/bin/python3 -c 'import numpy, pydicom' 2>/dev/null"), 0)
      << "python3-pydicom is not installed";
  std::filesystem::create_directory(folder_ / "ct");
  Write("recipe.json", Recipe(""));
  ASSERT_EQ(std::system(SoftAndBone((folder_ / "ct").string(), "2.25.1").c_str()), 0);
  const ProcessResult made =
      BuildFrom("ct", {"--out", "head", "--no-pictures", "--accept-defects"});
  ASSERT_THAT(made, Succeeds());
  EXPECT_THAT(made.out,
              AllOf(HasSubstr("CT      chosen of 2 CT series of one study: series 2 (93 axial"),
                    HasSubstr("not series 1: the chosen series has a softer kernel"),
                    Not(HasSubstr("Planted"))));
  ASSERT_EQ(std::system(SoftAndBone((folder_ / "ct").string(), "2.25.2").c_str()), 0);
  EXPECT_THAT(BuildFrom("ct", {"--out", "other"}),
              FailsWith(1, HasSubstr("the default rule does not choose between studies")));
}

// The bundled CT without its lowest slices, as a volume that says all of itself.
std::string CroppedNrrd(int slices) {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  const CtVolume volume =
      ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options).value();
  const Eigen::Matrix3d steps = volume.StepsMm();
  std::string header =
      absl::StrCat("NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: ",
                   volume.size[0], " ", volume.size[1], " ", slices, "\nspace directions:");
  for (int axis = 0; axis < 3; ++axis) {
    absl::StrAppend(&header, " (", steps(0, axis), ",", steps(1, axis), ",", steps(2, axis), ")");
  }
  const size_t voxels = size_t{1} * volume.size[0] * volume.size[1] * slices;
  return absl::StrCat(
      header, "\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n",
      absl::string_view(reinterpret_cast<const char*>(volume.hu.data()), voxels * sizeof(int16_t)));
}

TEST_F(PlanBuildTest, CtAboveTheLowerJawIsRefused) {
  Write("recipe.json", Recipe(""));
  Write("upper.nrrd", CroppedNrrd(50));
  EXPECT_THAT(BuildFrom("upper.nrrd"), FailsWith(1, HasSubstr("lower jaw")));
  EXPECT_THAT(Files(), ElementsAre("recipe.json", "upper.nrrd"));
}

}  // namespace
}  // namespace tissueform::testing
