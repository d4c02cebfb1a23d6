// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "absl/strings/ascii.h"
#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/bar_mesh.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

using MeshCheckTest = CliTest;

TEST_F(MeshCheckTest, GoodMeshIsUsable) {
  const ProcessResult result =
      Run({"mesh", "check", TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu")});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("2238"), HasSubstr("10980"), HasSubstr("verdict: usable")));
}

TEST_F(MeshCheckTest, WarningsAreReportedAndDoNotFail) {
  const ProcessResult result =
      Run({"mesh", "check", TestDataPath("meshes/tet_sofa_raptor/raptorTetra_8418.vtu")});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("unreferenced_vertices"), HasSubstr("verdict: usable")));
}

TEST_F(MeshCheckTest, JsonHoldsTheSameFigures) {
  const ProcessResult result = Run({"mesh", "check", "--json", TestDataPath("plans/bar/bar.vtu")});
  EXPECT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["usable"], true);
  EXPECT_EQ(json["vertices"], 325);
  EXPECT_EQ(json["tets"], 1152);
  EXPECT_EQ(json["point_data"][0]["name"], "anatomy");
  EXPECT_EQ(json["point_data"][0]["type"], "int32");
  EXPECT_TRUE(json["defects"].empty());
}

TEST_F(MeshCheckTest, InvertedTetMakesTheMeshUnusable) {
  TetMeshFile bar = BarMeshOfPlan();
  TetIndices tets = bar.mesh.tets();
  std::swap(tets(7, 0), tets(7, 1));
  ASSERT_OK_AND_ASSIGN(bar.mesh, TetMesh::Create(bar.mesh.positions(), tets));
  ASSERT_THAT(WriteTetMesh(Path("inverted.vtu"), bar), IsOk());
  const ProcessResult result = Run({"mesh", "check", "inverted.vtu"});
  EXPECT_THAT(result, FailsWith(1, HasSubstr("inverted.vtu")));
  EXPECT_THAT(result.out, AllOf(HasSubstr("inverted_tets"), HasSubstr("verdict: not usable")));
  const ProcessResult as_json = Run({"mesh", "check", "inverted.vtu", "--json"});
  EXPECT_THAT(as_json, FailsWith(1, HasSubstr("inverted.vtu")));
  EXPECT_EQ(nlohmann::json::parse(as_json.out)["defects"][0]["examples"][0], 7);
}

TEST_F(MeshCheckTest, TetsThatAreAllNegativeAreUsableAndReported) {
  Write("turned.node", "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n");
  Write("turned.ele", "1 4 0\n1 2 1 3 4\n");
  const ProcessResult result = Run({"mesh", "check", "turned.ele", "--json"});
  EXPECT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["defects"][0]["kind"], "reoriented_tets");
  EXPECT_EQ(json["defects"][0]["severity"], "warning");
}

TEST_F(MeshCheckTest, OmitsAndReportsCellsThatAreNotTets) {
  const std::string mixed = TestDataPath("meshes/mixed_cells/meshio.vtk");
  const ProcessResult result = Run({"mesh", "check", mixed, "--json"});
  EXPECT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["tets"], 2);
  EXPECT_EQ(json["defects"][0]["kind"], "left_out_cells");
  EXPECT_EQ(json["defects"][0]["severity"], "warning");
  EXPECT_EQ(json["defects"][0]["count"], 5);
  EXPECT_EQ(json["defects"][1]["kind"], "unreferenced_vertices");
}

TEST_F(MeshCheckTest, JsonHoldsTheCountOfNegativeWeights) {
  const std::string tongue = TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu");
  const nlohmann::json json = nlohmann::json::parse(Run({"mesh", "check", tongue, "--json"}).out);
  EXPECT_EQ(json["kind"], "tets");
  EXPECT_EQ(json["edges"], 14187);
  EXPECT_GT(json["negative_cotangent_weights"], 0);
}

TEST_F(MeshCheckTest, OpenSurfaceIsReportedAsOpen) {
  const std::string box = TestDataPath("meshes/surf_manifold_tests/boxNotManifold.obj");
  const ProcessResult text = Run({"mesh", "check", box});
  EXPECT_THAT(text, Succeeds());
  EXPECT_THAT(text.out, AllOf(HasSubstr("open_edges"), HasSubstr("not closed")));
  const nlohmann::json json = nlohmann::json::parse(Run({"mesh", "check", box, "--json"}).out);
  EXPECT_EQ(json["kind"], "surface");
  EXPECT_EQ(json["closed"], false);
  EXPECT_EQ(json["vertices"], 9);
  EXPECT_EQ(json["open_edges"], 4);
}

TEST_F(MeshCheckTest, NonManifoldSurfaceIsReportedAsSuch) {
  Write("fin.off", "OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n3 0 1 4\n");
  const nlohmann::json json =
      nlohmann::json::parse(Run({"mesh", "check", "fin.off", "--json"}).out);
  EXPECT_EQ(json["non_manifold_edges"], 1);
  EXPECT_EQ(json["open_edges"], 6);
  EXPECT_EQ(json["euler_characteristic"], 1);
}

TEST_F(MeshCheckTest, AMeshThatIsProbablyNotInMillimetersIsUsableWithAWarning) {
  const auto size_defect = [this](const std::string& name, double scale_mm) {
    TetMeshFile bar = BarMeshOfPlan();
    bar.mesh = *TetMesh::Create(bar.mesh.positions() * (scale_mm / bar.mesh.BoundingBoxDiagonal()),
                                bar.mesh.tets());
    EXPECT_THAT(WriteTetMesh(Path(name), bar), IsOk());
    const ProcessResult result = Run({"mesh", "check", name, "--json"});
    EXPECT_THAT(result, Succeeds());
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json["usable"], true);
    return json["defects"].empty() ? nlohmann::json() : json["defects"][0];
  };
  EXPECT_TRUE(size_defect("head.vtu", 250).is_null());
  EXPECT_TRUE(size_defect("tooth.vtu", 10.01).is_null());
  EXPECT_TRUE(size_defect("crowd.vtu", 1999).is_null());
  const nlohmann::json meters = size_defect("meters.vtu", 0.1158);
  EXPECT_EQ(meters["kind"], "implausible_size");
  EXPECT_EQ(meters["severity"], "warning");
  EXPECT_THAT(std::string(meters["explanation"]),
              AllOf(HasSubstr("0.1158 mm, less than 10 mm"), HasSubstr("in meters, multiply")));
  EXPECT_THAT(std::string(size_defect("centimeters.vtu", 5)["explanation"]),
              HasSubstr("in centimeters, multiply its coordinates by 10"));
  EXPECT_THAT(
      std::string(size_defect("micrometers.vtu", 250'000)["explanation"]),
      AllOf(HasSubstr("more than 2000 mm"), HasSubstr("in micrometers, multiply its coordinates")));
  EXPECT_THAT(std::string(size_defect("unknown.vtu", 5000)["explanation"]),
              HasSubstr("check the unit"));
}

TEST_F(MeshCheckTest, ReportsTheSpaceThatASurfaceFileStates) {
  const std::string facets =
      "\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 30 0 0\nvertex 0 40 0\nendloop\n"
      "endfacet\nendsolid\n";
  Write("ras.stl", "solid 3D Slicer output. SPACE=RAS" + facets);
  Write("lps.stl", "solid 3D Slicer output. SPACE=LPS" + facets);
  Write("unstated.stl", "solid a" + facets);
  Write("unknown.stl", "solid a SPACE=XYZ" + facets);
  EXPECT_THAT(Run({"mesh", "check", "ras.stl"}).out,
              HasSubstr("LPS; the file states RAS: x and y were negated"));
  EXPECT_THAT(Run({"mesh", "check", "lps.stl"}).out, HasSubstr("LPS, as the file states"));
  for (const char* file : {"unstated.stl", "unknown.stl"}) {
    EXPECT_THAT(Run({"mesh", "check", file}).out,
                HasSubstr("assumed to be LPS; the file states neither LPS nor RAS"));
  }
  EXPECT_THAT(Run({"mesh", "check", "ras.stl", "--json"}).out,
              HasSubstr("\"stated_space\": \"RAS\""));
}

TEST_F(MeshCheckTest, SurfaceWithoutAreaIsNotUsable) {
  Write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  const ProcessResult result = Run({"mesh", "check", "flat.obj"});
  EXPECT_THAT(result, FailsWith(1, HasSubstr("no area")));
  EXPECT_THAT(result.out, HasSubstr("verdict: not usable"));
}

struct SharedMesh {
  const char* path;
  int exit_code;
  const char* said;  // on stdout, or on stderr where it cannot be read at all
};

// The outcome of `mesh check` on every mesh that lies beside a developer's checkout.
class SharedMeshTest : public MeshCheckTest, public ::testing::WithParamInterface<SharedMesh> {};

TEST_P(SharedMeshTest, HasItsRecordedOutcome) {
  const std::string path = SharedDataPath(GetParam().path);
  if (path.empty()) GTEST_SKIP() << "the large data sets are not here";
  const ProcessResult result = Run({"mesh", "check", path});
  EXPECT_EQ(result.exit_code, GetParam().exit_code) << result.err;
  EXPECT_THAT(result.out + result.err, HasSubstr(GetParam().said));
}

INSTANTIATE_TEST_SUITE_P(
    Data, SharedMeshTest,
    ::testing::Values(
        SharedMesh{"surf_manifold_tests/boxNotManifold.obj", 0, "not closed"},
        SharedMesh{"surf_sofa_dentistry/head.obj", 0, "split_polygons"},
        SharedMesh{"surf_sofa_dentistry/skull_and_teeth_coarse.obj", 0, "non_manifold_edges"},
        SharedMesh{"surf_sofa_dentistry/teeth.obj", 0, "several_components"},
        SharedMesh{"surf_sofa_dentistry/tooth_coarse_mesh.obj", 0, "not closed"},
        SharedMesh{"surf_sofa_liver_smooth/liver-smooth.obj", 0, "usable, closed"},
        SharedMesh{"tet_sofa_tongue/tongue.obj", 0, "usable, closed"},
        SharedMesh{"tet_chaste_ellipsoid/ellipsoid_15811_elements.node", 0, "15811"},
        SharedMesh{"tet_chaste_ellipsoid/ellipsoid_15811_elements.ele", 0, "verdict: usable"},
        SharedMesh{"tet_ipc_armadillo13k/Armadillo13K.msh", 0, "54985"},
        SharedMesh{"tet_mmg_tinybox/tinyBoxt.mesh", 0, "63434"},
        SharedMesh{"tet_sofa_armadillo_ok_and_broken/Armadillo_Tetra_4406.vtu", 0, "4406"},
        SharedMesh{"tet_sofa_armadillo_ok_and_broken/Armadillo_Tetra_4406_for_test_broken.vtu", 1,
                   "than the header says"},
        SharedMesh{"tet_sofa_gmsh1/cylinder.msh", 0, "2430"},
        SharedMesh{"tet_sofa_gmsh1/liver2.msh", 0, "left_out_cells"},
        SharedMesh{"tet_sofa_raptor/raptorTetra_19409.vtu", 0, "unreferenced_vertices"},
        SharedMesh{"tet_sofa_raptor/raptorTetra_8418.vtu", 0, "non_manifold_edges"},
        SharedMesh{"tet_sofa_small_inverted/6_tetra_bad.msh", 1, "inverted_tets"},
        SharedMesh{"tet_sofa_tongue/volumetricTongue.vtu", 0, "verdict: usable"}),
    [](const auto& test) {
      std::string name = test.param.path;
      for (char& c : name) c = absl::ascii_isalnum(static_cast<unsigned char>(c)) ? c : '_';
      return name;
    });

}  // namespace
}  // namespace tissueform::testing
