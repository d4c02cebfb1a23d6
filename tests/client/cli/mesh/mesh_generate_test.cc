// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/validation.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using MeshGenerateTest = CliTest;

// A cube of 2 mm in 12 triangles, with its low corner at (at, at, at), as the text of an .off
// file's vertices and faces.
std::string CubeVertices(double at) {
  std::string text;
  for (int v = 0; v < 8; ++v) {
    for (const int axis : {0, 1, 2}) text += std::to_string(at + 2 * (v >> axis & 1)) + " ";
    text += "\n";
  }
  return text;
}
std::string CubeFaces(int first) {
  std::string text;
  for (const auto& t : std::vector<std::array<int, 3>>{{0, 2, 1},
                                                       {1, 2, 3},
                                                       {4, 5, 6},
                                                       {5, 7, 6},
                                                       {0, 1, 4},
                                                       {1, 5, 4},
                                                       {2, 6, 3},
                                                       {3, 6, 7},
                                                       {0, 4, 2},
                                                       {2, 4, 6},
                                                       {1, 3, 5},
                                                       {3, 7, 5}}) {
    text += "3";
    for (const int v : t) text += " " + std::to_string(first + v);
    text += "\n";
  }
  return text;
}
std::string Cube() { return "OFF\n8 12 0\n" + CubeVertices(0) + CubeFaces(0); }
std::string TwoCubes(double apart) {
  return "OFF\n16 24 0\n" + CubeVertices(0) + CubeVertices(apart) + CubeFaces(0) + CubeFaces(8);
}

double VolumeOf(const TetMesh& mesh) { return TetVolumes(mesh.positions(), mesh.tets()).sum(); }

TEST_F(MeshGenerateTest, CubeIsFilledWithTets) {
  Write("cube.off", Cube());
  const ProcessResult result = Run(
      {"mesh", "generate", "cube.off", "--out", "cube.vtu", "--split-surface", "--edge-mm", "0.6"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("cube.off"), HasSubstr("verdict: usable")));
  EXPECT_THAT(Files(), ElementsAre("cube.off", "cube.vtu"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(Path("cube.vtu")));
  EXPECT_NEAR(VolumeOf(file.mesh), 8, 1e-9);
  EXPECT_GT(file.mesh.num_tets(), 300);
  EXPECT_TRUE(ValidateTetMesh(file.mesh).defects.empty());
}

TEST_F(MeshGenerateTest, JsonHoldsSurfaceRemeshingAndMesh) {
  Write("cube.off", Cube());
  const ProcessResult result = Run({"mesh", "generate", "cube.off", "--out", "cube.vtu",
                                    "--remesh-mm", "0.7", "--json", "--defects", "all.vtp"});
  EXPECT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["filled"], true);
  EXPECT_EQ(json["surface"]["triangles"], 12);
  EXPECT_EQ(json["surface"]["intersecting_pairs"], 0);
  EXPECT_EQ(json["remeshing"]["edge_mm"], 0.7);
  EXPECT_GT(json["remeshing"]["triangles"], 50);
  EXPECT_EQ(json["mesh"]["usable"], true);
  EXPECT_EQ(json["defect_file"], "all.vtp");
  EXPECT_THAT(Files(), Contains("all.vtp"));
}

TEST_F(MeshGenerateTest, RegionsAreAnArrayAndHolesAreEmpty) {
  Write("two.off", TwoCubes(3));
  const std::vector<std::string> command = {"mesh", "generate", "two.off", "--out", "two.vtu"};
  std::vector<std::string> regions = command;
  regions.insert(regions.end(), {"--region", "1,1,1,5", "--region", "4,4,4,-2,0.1"});
  EXPECT_THAT(Run(regions), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(Path("two.vtu")));
  const Attribute* region = FindAttribute(file.cell_data, "region");
  ASSERT_NE(region, nullptr);
  const std::vector<double> numbers = ToDoubles(*region);
  const Eigen::VectorXd volumes = TetVolumes(file.mesh.positions(), file.mesh.tets());
  double first = 0;
  for (Eigen::Index t = 0; t < volumes.size(); ++t) first += numbers[t] == 5 ? volumes[t] : 0;
  EXPECT_NEAR(first, 8, 1e-9);
  EXPECT_NEAR(volumes.sum(), 16, 1e-9);

  std::vector<std::string> hole = command;
  hole.insert(hole.end(), {"--hole", "4,4,4"});
  EXPECT_THAT(Run(hole), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile one, ReadTetMesh(Path("two.vtu")));
  EXPECT_NEAR(VolumeOf(one.mesh), 8, 1e-9);
}

TEST_F(MeshGenerateTest, CubesThatGoThroughEachOtherAreRefusedWithAFileToLookAt) {
  Write("two.off", TwoCubes(1.3));
  const ProcessResult result = Run({"mesh", "generate", "two.off", "--out", "two.vtu", "--json"});
  EXPECT_THAT(result, FailsWith(1, AllOf(HasSubstr("two.off"), HasSubstr("triangles intersect"),
                                         HasSubstr("two.defects.vtp"))));
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["filled"], false);
  EXPECT_EQ(json["defect_file"], "two.defects.vtp");
  EXPECT_THAT(Files(), ElementsAre("two.defects.vtp", "two.off"));
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile marked, ReadTriangleMesh(Path("two.defects.vtp")));
  const Attribute* defect = FindAttribute(marked.cell_data, "defect");
  ASSERT_NE(defect, nullptr);
  const std::vector<double> flaws = ToDoubles(*defect);
  const Eigen::Index crossing = std::count(flaws.begin(), flaws.end(), 4.0);
  EXPECT_EQ(json["surface"]["defects"][0]["count"], crossing);
  EXPECT_GT(crossing, 5);
  EXPECT_LT(crossing, 24);
}

TEST_F(MeshGenerateTest, OpenBoxIsRefusedAndAnOldMeshStays) {
  Write("box.vtu", "old");
  const ProcessResult result =
      Run({"mesh", "generate", TestDataPath("meshes/surf_manifold_tests/boxNotManifold.obj"),
           "--out", "box.vtu", "--defects", "why.vtp"});
  EXPECT_THAT(result, FailsWith(1, AllOf(HasSubstr("4 edges have only one triangle"),
                                         HasSubstr("why.vtp"))));
  EXPECT_THAT(result.out, AllOf(HasSubstr("open_edges"), HasSubstr("verdict: not filled")));
  EXPECT_EQ(Read("box.vtu"), "old");
  EXPECT_THAT(Files(), ElementsAre("box.vtu", "why.vtp"));
}

TEST_F(MeshGenerateTest, WrapsASurfaceThatIsOtherwiseRefused) {
  Write("two.off", TwoCubes(1.3));
  EXPECT_THAT(Run({"mesh", "generate", "two.off", "--out", "a.vtu"}),
              FailsWith(1, HasSubstr("wrap it (`--wrap-mm`)")));
  const ProcessResult wrapped =
      Run({"mesh", "generate", "two.off", "--out", "a.vtu", "--wrap-mm", "0.1", "--json"});
  ASSERT_THAT(wrapped, Succeeds());
  const nlohmann::json report = nlohmann::json::parse(wrapped.out);
  EXPECT_DOUBLE_EQ(report["wrapping"]["alpha_mm"].get<double>(), 0.3);
  EXPECT_LE(report["wrapping"]["largest_to_surface_mm"].get<double>(), 0.4);
  EXPECT_GT(report["wrapping"]["covered_fraction"].get<double>(), 0.01);
  EXPECT_FALSE(report["wrapping"]["is_sheet"].get<bool>());
  EXPECT_THAT(Run({"mesh", "generate", "two.off", "--out", "b.vtu", "--wrap-mm", "0.0001"}),
              FailsWith(1, HasSubstr("use an offset of")));
}

TEST_F(MeshGenerateTest, DoesNotSuggestAWrapThatWouldNotHelp) {
  Write("half.off", "OFF\n4 2 0\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n3 0 1 2\n3 0 1 3\n");
  EXPECT_THAT(Run({"mesh", "generate", "half.off", "--out", "a.vtu"}),
              FailsWith(1, ::testing::Not(HasSubstr("--wrap-mm"))));
}

TEST_F(MeshGenerateTest, TimeLimitIsOneLine) {
  Write("cube.off", Cube());
  EXPECT_THAT(Run({"mesh", "generate", "cube.off", "--out", "cube.vtu", "--split-surface",
                   "--edge-mm", "0.01", "--max-seconds", "1"}),
              FailsWith(1, HasSubstr("1 seconds")));
  EXPECT_THAT(Files(), ElementsAre("cube.off"));
}

TEST_F(MeshGenerateTest, WrongUsageIsReportedBeforeAnyFileIsRead) {
  const std::vector<std::string> command = {"mesh", "generate", "none.off", "--out", "a.vtu"};
  const auto with = [&](const std::string& option, const std::string& value) {
    std::vector<std::string> all = command;
    all.insert(all.end(), {option, value});
    return Run(all);
  };
  EXPECT_THAT(Run({"mesh", "generate", "none.off"}), FailsWith(2, HasSubstr("--out")));
  EXPECT_THAT(with("--region", "1,2,3"), FailsWith(2, HasSubstr("X,Y,Z,NUMBER")));
  EXPECT_THAT(with("--hole", "1,2,x"), FailsWith(2, HasSubstr("X,Y,Z")));
  EXPECT_THAT(with("--remesh-mm", "-1"), FailsWith(2, HasSubstr("--remesh-mm")));
  EXPECT_THAT(with("--min-dihedral-deg", "60"), FailsWith(2, HasSubstr("--min-dihedral-deg")));
  EXPECT_THAT(with("--defects", "a.stl"), FailsWith(2, HasSubstr(".vtp")));
  EXPECT_THAT(Run(command), FailsWith(1, HasSubstr("none.off")));
}

TEST_F(MeshGenerateTest, SurfaceThatGoesThroughItselfIsFilledAfterRemeshing) {
  const std::string path = SharedDataPath("surf_sofa_liver_smooth/liver-smooth.obj");
  if (path.empty()) GTEST_SKIP() << "the large data sets are not here";
  const ProcessResult result =
      Run({"mesh", "generate", path, "--out", "liver.vtu", "--remesh-mm", "0.2", "--json"});
  EXPECT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_GT(json["surface"]["intersecting_pairs"], 0);
  EXPECT_EQ(json["mesh"]["usable"], true);
  // The source's volume is wrong by what it encloses twice, which is little.
  const double volume = json["surface"]["enclosed_volume_mm3"];
  EXPECT_NEAR(json["mesh"]["quality"]["total_volume_mm3"], volume, 0.01 * volume);
}

struct SharedSurface {
  const char* path;
  const char* said;  // on stderr; empty: it is filled
};

// The outcome of `mesh generate` on every surface that lies beside a developer's checkout. TetGen
// itself crashes on most of them, or ends without a word.
class SharedSurfaceTest : public MeshGenerateTest,
                          public ::testing::WithParamInterface<SharedSurface> {};

TEST_P(SharedSurfaceTest, IsFilledOrRefusedWithTheDefect) {
  const std::string path = SharedDataPath(GetParam().path);
  if (path.empty()) GTEST_SKIP() << "the large data sets are not here";
  const ProcessResult result = Run({"mesh", "generate", path, "--out", "out.vtu"});
  if (std::string(GetParam().said).empty()) {
    EXPECT_THAT(result, Succeeds());
    EXPECT_THAT(Files(), ElementsAre("out.vtu"));
  } else {
    EXPECT_THAT(result, FailsWith(1, HasSubstr(GetParam().said)));
    EXPECT_THAT(Files(), ElementsAre("out.defects.vtp"));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Data, SharedSurfaceTest,
    ::testing::Values(
        SharedSurface{"surf_manifold_tests/boxNotManifold.obj", "4 edges have only one triangle"},
        SharedSurface{"surf_sofa_dentistry/head.obj", "40 edges have only one triangle"},
        SharedSurface{"surf_sofa_dentistry/skull_and_teeth_coarse.obj",
                      "3 edges have only one triangle"},
        SharedSurface{"surf_sofa_dentistry/teeth.obj", "175 edges have only one triangle"},
        SharedSurface{"surf_sofa_dentistry/tooth_coarse_mesh.obj",
                      "157 edges have only one triangle"},
        SharedSurface{"surf_sofa_liver_smooth/liver-smooth.obj", "triangles intersect"},
        SharedSurface{"tet_sofa_tongue/tongue.obj", ""}),
    [](const auto& test) {
      std::string name = test.param.path;
      for (char& c : name) c = absl::ascii_isalnum(static_cast<unsigned char>(c)) ? c : '_';
      return name;
    });

}  // namespace
}  // namespace tissueform::testing
