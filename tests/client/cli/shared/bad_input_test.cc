// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <fstream>
#include <limits>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/bar_mesh.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

// Bad files and plans at the program's own border: exit code 1, one line on stderr, nothing
// written.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class BadInputTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    WriteBar();
  }

  // Runs `deform` on the bundled plan of the bar with the value at a JSON pointer replaced.
  ProcessResult DeformWith(const std::string& pointer, const nlohmann::json& value) {
    std::ifstream stream(TestDataPath("plans/bar/plan.json"));
    nlohmann::json plan = nlohmann::json::parse(stream);
    plan[nlohmann::json::json_pointer(pointer)] = value;
    return DeformText(plan.dump());
  }

  ProcessResult DeformText(const std::string& text) {
    Write("plan.json", text);
    const ProcessResult result =
        Run({"deform", "plan.json", "--out", "out.vtu", "--stats", "stats.json"});
    EXPECT_THAT(Files(), ElementsAre("bar.vtu", "plan.json"));
    return result;
  }

  // Puts a changed bar beside the plan and runs it.
  ProcessResult DeformMesh(const TetMesh& mesh) {
    const std::vector<double> pa(static_cast<size_t>(mesh.num_tets()), 3000);
    std::vector<int32_t> anatomy(static_cast<size_t>(mesh.num_vertices()), 0);
    anatomy[0] = 1;
    anatomy[324] = 2;
    EXPECT_THAT(WriteTetMesh(Path("bar.vtu"), {.mesh = mesh,
                                               .point_data = {{"anatomy", 1, anatomy}},
                                               .cell_data = {{"youngs_modulus_pa", 1, pa}}}),
                IsOk());
    return DeformWith("/version", 1);
  }
};

auto IsRefused(const std::string& why) { return FailsWith(1, HasSubstr(why)); }

TEST_F(BadInputTest, MissingFiles) {
  EXPECT_THAT(Run({"mesh", "check", "missing.vtu"}), IsRefused("missing.vtu does not exist"));
  EXPECT_THAT(Run({"plan", "check", "missing.json"}), IsRefused("missing.json does not exist"));
  EXPECT_THAT(DeformWith("/mesh", "missing.vtu"), IsRefused("missing.vtu does not exist"));
  EXPECT_THAT(Run({"compare", "bar.vtu", "missing.vtu"}), IsRefused("missing.vtu does not exist"));
}

TEST_F(BadInputTest, TruncatedMesh) {
  const std::string whole = Read("bar.vtu");
  for (int tenths = 0; tenths < 10; ++tenths) {
    Write("bar.vtu", whole.substr(0, whole.size() * tenths / 10));
    EXPECT_THAT(Run({"mesh", "check", "bar.vtu"}), IsRefused("bar.vtu")) << tenths;
  }
  EXPECT_THAT(DeformWith("/version", 1), IsRefused("bar.vtu"));
}

TEST_F(BadInputTest, MislabelledMesh) {
  std::filesystem::copy_file(TestDataPath("meshes/tet_sofa_small_inverted/6_tetra_bad.msh"),
                             folder_ / "bar.vtu",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(Run({"mesh", "check", "bar.vtu"}), IsRefused("Gmsh"));
  EXPECT_THAT(DeformWith("/version", 1), IsRefused("Gmsh"));
}

TEST_F(BadInputTest, HeaderThatDisagreesWithItsArrays) {
  const std::string broken = TestDataPath(
      "meshes/tet_sofa_armadillo_ok_and_broken/Armadillo_Tetra_4406_for_test_broken.vtu");
  EXPECT_THAT(Run({"mesh", "check", broken}), IsRefused("than the header says"));
  std::filesystem::copy_file(broken, folder_ / "bar.vtu",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(DeformWith("/version", 1), IsRefused("than the header says"));
}

TEST_F(BadInputTest, MeshOutsideTheFolderOfThePlan) {
  const std::filesystem::path outside = folder_.string() + ".outside.vtu";
  std::filesystem::copy_file(folder_ / "bar.vtu", outside,
                             std::filesystem::copy_options::overwrite_existing);
  const std::string dotted = "../" + outside.filename().string();
  EXPECT_THAT(DeformWith("/mesh", dotted), IsRefused("--allow-outside"));
  EXPECT_THAT(DeformWith("/mesh", outside.string()), IsRefused("--allow-outside"));
  EXPECT_THAT(Run({"plan", "check", "plan.json"}), IsRefused("--allow-outside"));
  EXPECT_THAT(Run({"plan", "check", "plan.json", "--allow-outside"}), Succeeds());
  EXPECT_THAT(Run({"run", "plan.json", "--server", "localhost:1", "--out", "out.vtu"}),
              IsRefused("--allow-outside"));
  EXPECT_THAT(Run({"deform", "plan.json", "--out", "out.vtu", "--allow-outside"}), Succeeds());
  std::filesystem::remove(outside);
}

TEST_F(BadInputTest, InvertedTetOfAnotherProgram) {
  const std::string six = TestDataPath("meshes/tet_sofa_small_inverted/6_tetra_bad.msh");
  EXPECT_THAT(Run({"mesh", "check", six}), IsRefused("1 tets have negative volume"));
}

TEST_F(BadInputTest, SurfaceInsteadOfTets) {
  Write("skin.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::ifstream stream(TestDataPath("plans/bar/plan.json"));
  nlohmann::json plan = nlohmann::json::parse(stream);
  plan["mesh"] = "skin.obj";
  Write("plan.json", plan.dump());
  EXPECT_THAT(Run({"plan", "check", "plan.json"}), IsRefused("a mesh of tets is needed"));
}

TEST_F(BadInputTest, InvertedAndDegenerateTets) {
  const TetMesh bar = BarMeshOfPlan().mesh;
  TetIndices inverted = bar.tets();
  std::swap(inverted(9, 0), inverted(9, 1));
  ASSERT_OK_AND_ASSIGN(const TetMesh with_inverted, TetMesh::Create(bar.positions(), inverted));
  EXPECT_THAT(DeformMesh(with_inverted),
              FailsWith(1, AllOf(HasSubstr("bar.vtu"), HasSubstr("tet 9"))));
  TetIndices degenerate = bar.tets();
  degenerate(9, 0) = degenerate(9, 1);
  ASSERT_OK_AND_ASSIGN(const TetMesh with_degenerate, TetMesh::Create(bar.positions(), degenerate));
  EXPECT_THAT(DeformMesh(with_degenerate),
              FailsWith(1, AllOf(HasSubstr("bar.vtu"), HasSubstr("tet 9"))));
}

TEST_F(BadInputTest, ComponentWithoutConstraint) {
  const TetMesh bar = BarMeshOfPlan().mesh;
  Positions positions(2 * bar.num_vertices(), 3);
  positions << bar.positions(), bar.positions().rowwise() + Eigen::RowVector3d(100, 0, 0);
  TetIndices tets(2 * bar.num_tets(), 4);
  tets << bar.tets(), bar.tets().array() + static_cast<int32_t>(bar.num_vertices());
  ASSERT_OK_AND_ASSIGN(const TetMesh two_bars, TetMesh::Create(positions, tets));
  EXPECT_THAT(DeformMesh(two_bars), IsRefused("component"));
}

TEST_F(BadInputTest, EmptyOverlappingAndOutOfRangeSelections) {
  EXPECT_THAT(DeformWith("/fixed/equals", 17), IsRefused("fixed selects no vertex"));
  EXPECT_THAT(DeformWith("/handles/0/region/equals", 17),
              IsRefused("handle \"top\" selects no vertex"));
  EXPECT_THAT(DeformWith("/handles/0/region/equals", 1), IsRefused("vertex 0"));
  EXPECT_THAT(DeformWith("/fixed", {{"vertices", {325}}}), IsRefused("vertex 325"));
}

TEST_F(BadInputTest, UnknownKeyAndWrongType) {
  EXPECT_THAT(DeformWith("/modle", "arap"), IsRefused("unknown key \"modle\" at /"));
  EXPECT_THAT(DeformWith("/handles", "top"), IsRefused("wrong type at /handles"));
}

TEST_F(BadInputTest, NonFiniteOrOutOfRangeNumbers) {
  EXPECT_THAT(DeformText(R"({"poisson_ratio": NaN})"), IsRefused("not valid JSON"));
  EXPECT_THAT(DeformText(R"({"poisson_ratio": -Infinity})"), IsRefused("not valid JSON"));
  EXPECT_THAT(DeformWith("/handles/0/pose/scale", 0), IsRefused("/handles/0/pose/scale"));
  EXPECT_THAT(DeformWith("/stiffness", {{"uniform", -1}}), IsRefused("/stiffness/uniform"));
  EXPECT_THAT(DeformWith("/unit", "inch"), IsRefused("/unit"));
}

TEST_F(BadInputTest, NonFiniteVertex) {
  Positions positions = BarMeshOfPlan().mesh.positions();
  positions(11, 0) = std::numeric_limits<double>::infinity();
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, BarMeshOfPlan().mesh.tets()));
  EXPECT_THAT(DeformMesh(mesh), IsRefused("11"));
}

TEST_F(BadInputTest, PoseSoLargeThatNumbersOverflow) {
  EXPECT_THAT(DeformWith("/handles/0/pose/scale", 1e308), IsRefused("finite"));
}

TEST_F(BadInputTest, ResultNeverReplacesTheMeshOfItsPlan) {
  Write("plan.json", "");
  std::filesystem::copy_file(TestDataPath("plans/bar/plan.json"), folder_ / "plan.json",
                             std::filesystem::copy_options::overwrite_existing);
  const std::string before = Read("bar.vtu");
  EXPECT_THAT(Run({"deform", "plan.json", "--out", "bar.vtu"}), IsRefused("the mesh of the plan"));
  EXPECT_EQ(Read("bar.vtu"), before);
}

TEST_F(BadInputTest, PlaceThatCannotBeWritten) {
  const std::string plan = TestDataPath("plans/bar/plan.json");
  EXPECT_THAT(Run({"deform", plan, "--out", "missing/out.vtu"}),
              IsRefused("there is no folder missing"));
  EXPECT_THAT(Run({"deform", plan, "--out", "out.vtu", "--stats", "missing/stats.json"}),
              IsRefused("there is no folder missing"));
  EXPECT_THAT(Run({"compare", "bar.vtu", "bar.vtu", "--out", "missing/d.vtu"}),
              IsRefused("missing"));
  EXPECT_THAT(Files(), ElementsAre("bar.vtu"));
}

TEST_F(BadInputTest, FullDiskLeavesTheOldFileAndNothingElse) {
  Write("out.vtu", "old");
  const ProcessResult result =
      RunCommandLine({"deform", TestDataPath("plans/bar/plan.json"), "--out", "out.vtu"}, folder_,
                     /*max_file_bytes=*/4096);
  EXPECT_THAT(result, IsRefused("out.vtu"));
  EXPECT_EQ(Read("out.vtu"), "old");
  EXPECT_THAT(Files(), ElementsAre("bar.vtu", "out.vtu"));
}

}  // namespace
}  // namespace tissueform::testing
