// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <sys/resource.h>

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/tet_topology.h"
#include "tests/core/mesh/io/mesh_folder.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// One mesh in every format of tets, and real meshes with figures known from other programs.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::NanSensitiveDoubleEq;
using tissueform::testing::BytesOfFile;
using tissueform::testing::IsOk;
using tissueform::testing::MeshFolder;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

std::string TwoTets(const std::string& name) { return TestDataPath("meshes/two_tets/" + name); }

std::vector<double> ValuesOf(const std::vector<Attribute>& attributes, const std::string& name) {
  const Attribute* attribute = FindAttribute(attributes, name);
  return attribute == nullptr ? std::vector<double>() : ToDoubles(*attribute);
}

class EveryTetFormatTest : public MeshFolder, public ::testing::WithParamInterface<const char*> {
 protected:
  // A changed copy of the file, for TetGen with its other half beside it, read without a word on
  // stderr.
  absl::StatusOr<TetMeshFile> ReadChanged(const std::string& contents) {
    if (Ending() == ".ele") Write("mesh.node", BytesOfFile(TwoTets("tetgen.node")));
    if (Ending() == ".node") Write("mesh.ele", BytesOfFile(TwoTets("tetgen.ele")));
    return Read("mesh" + Ending(), contents);
  }
  std::string Ending() const { return std::filesystem::path(GetParam()).extension().string(); }
};

TEST_P(EveryTetFormatTest, HoldsTheSameMesh) {
  Positions positions(5, 3);
  positions << 0, 0, 0, 1.5, 0, 0.1, 0, 2.25, 0, 0.125, 0.25, 3, 2, 2.5, 3.5;
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 1, 2, 3, 4;
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TwoTets(GetParam())));
  EXPECT_EQ(file.mesh.positions(), positions);
  EXPECT_EQ(file.mesh.tets(), tets);
  EXPECT_EQ(file.reoriented_tets, 0);
}

TEST_P(EveryTetFormatTest, TruncatedAnywhereIsRefusedOrStillTheWholeGeometry) {
  const std::string whole = BytesOfFile(TwoTets(GetParam()));
  int refused = 0;
  for (size_t tenth = 0; tenth < 10; ++tenth) {
    const absl::StatusOr<TetMeshFile> file =
        ReadChanged(whole.substr(0, whole.size() * tenth / 10));
    if (!file.ok()) {
      ++refused;
      EXPECT_THAT(file, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mesh."))) << tenth;
      continue;
    }
    EXPECT_EQ(file->mesh.num_vertices(), 5) << tenth;
    EXPECT_EQ(file->mesh.num_tets(), 2) << tenth;
  }
  EXPECT_GE(refused, 5);
}

TEST_P(EveryTetFormatTest, ChangedBytesNeverEndTheProgram) {
  const std::string whole = BytesOfFile(TwoTets(GetParam()));
  std::mt19937 generator(3);
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    std::string contents = whole;
    for (int change = 0; change < 3; ++change) {
      contents[generator() % contents.size()] = static_cast<char>(generator());
    }
    if (!ReadChanged(contents).ok()) ++refused;
  }
  EXPECT_GT(refused, 10);
}

INSTANTIATE_TEST_SUITE_P(Files, EveryTetFormatTest,
                         ::testing::Values("legacy_ascii.vtk", "legacy_binary.vtk",
                                           "gmsh1_ascii.msh", "gmsh22_ascii.msh",
                                           "gmsh22_binary.msh", "gmsh41_ascii.msh",
                                           "gmsh41_binary.msh", "medit.mesh", "tetgen.node",
                                           "tetgen.ele"),
                         [](const auto& test) {
                           std::string name = test.param;
                           name[name.find('.')] = '_';
                           return name;
                         });

using TetFormatsTest = MeshFolder;

TEST_F(TetFormatsTest, EndingIsTakenInAnyCase) {
  EXPECT_THAT(Read("A.MSH", BytesOfFile(TwoTets("gmsh22_ascii.msh"))), IsOk());
  EXPECT_THAT(Read("A.Vtk", BytesOfFile(TwoTets("legacy_ascii.vtk"))), IsOk());
  EXPECT_THAT(Read("A.MESH", BytesOfFile(TwoTets("medit.mesh"))), IsOk());
  Write("A.ELE", BytesOfFile(TwoTets("tetgen.ele")));
  EXPECT_THAT(Read("A.NODE", BytesOfFile(TwoTets("tetgen.node"))), IsOk());
}

TEST_F(TetFormatsTest, LegacyVtkKeepsAllItsArrays) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TwoTets("legacy_ascii.vtk")));
  EXPECT_THAT(ValuesOf(file.cell_data, "youngs_modulus_pa"), ElementsAre(3000, 15000.5));
  EXPECT_THAT(ValuesOf(file.cell_data, "material"), ElementsAre(7, 9));
  EXPECT_THAT(ValuesOf(file.point_data, "anatomy"), ElementsAre(1, 1, 0, 0, 2));
  ASSERT_NE(FindAttribute(file.point_data, "normal"), nullptr);
  EXPECT_EQ(FindAttribute(file.point_data, "normal")->components, 3);
}

TEST_F(TetFormatsTest, GmshKeepsGroupsAndData) {
  for (const char* name :
       {"gmsh22_ascii.msh", "gmsh22_binary.msh", "gmsh41_ascii.msh", "gmsh41_binary.msh"}) {
    ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TwoTets(name)));
    EXPECT_THAT(ValuesOf(file.cell_data, "gmsh_entity"), ElementsAre(1, 2)) << name;
    EXPECT_THAT(ValuesOf(file.cell_data, "gmsh_physical"), ElementsAre(7, 9)) << name;
    EXPECT_THAT(ValuesOf(file.cell_data, "youngs_modulus_pa"), ElementsAre(3000, 15000.5)) << name;
    EXPECT_THAT(ValuesOf(file.point_data, "anatomy"), ElementsAre(1, 1, 0, 0, 2)) << name;
  }
}

TEST_F(TetFormatsTest, TetsSkippedByGmshDataGetNan) {
  std::string text = BytesOfFile(TwoTets("gmsh22_ascii.msh"));
  const std::string both = "2\n1 3000\n2 15000.5\n";
  text.replace(text.find(both), both.size(), "1\n2 15000.5\n");
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, Read("part.msh", text));
  EXPECT_THAT(ValuesOf(file.cell_data, "youngs_modulus_pa"),
              ElementsAre(NanSensitiveDoubleEq(std::nan("")), 15000.5));
}

TEST_F(TetFormatsTest, GmshNodesThatNoTetUsesAreLeftOut) {
  ASSERT_OK_AND_ASSIGN(
      const TetMeshFile file,
      Read("unused.msh",
           "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 9 9 9\n3 0 0 0\n4 1 0 "
           "0\n6 0 1 0\n7 0 0 1\n$EndNodes\n$Elements\n2\n1 15 2 0 1 1\n2 4 2 0 1 3 "
           "4 6 7\n$EndElements\n"));
  EXPECT_EQ(file.mesh.num_vertices(), 4);
  EXPECT_EQ(file.mesh.positions().row(3), Eigen::RowVector3d(0, 0, 1));
}

TEST_F(TetFormatsTest, NamesGmshCellsThatAreNotLinearTets) {
  const std::string nodes =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 0 "
      "1\n6 0 1 1\n$EndNodes\n";
  EXPECT_THAT(Read("prism.msh", nodes + "$Elements\n1\n1 6 2 0 1 1 2 3 4 5 6\n$EndElements\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("prism.msh"), HasSubstr("Prism"))));
  EXPECT_THAT(Read("triangle.msh", nodes + "$Elements\n1\n1 2 2 0 1 1 2 3\n$EndElements\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no tets")));
}

// Gmsh would run such a script.
TEST_F(TetFormatsTest, GmshScriptIsNeitherReadNorRun) {
  const std::string script = "SystemCall \"touch " + Path("pwned") + "\";\n";
  EXPECT_THAT(Read("script.msh", script),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("script.msh"), HasSubstr("of unknown format"))));
  Write("mesh.msh.opt", script);
  EXPECT_THAT(Read("mesh.msh", BytesOfFile(TwoTets("gmsh41_ascii.msh"))), IsOk());
  EXPECT_THAT(Read("tail.msh", BytesOfFile(TwoTets("gmsh41_ascii.msh")) + script + "$EndScript\n"),
              IsOk());
  EXPECT_FALSE(std::filesystem::exists(Path("pwned")));
}

TEST_F(TetFormatsTest, MeditReferencesAreKept) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TwoTets("medit.mesh")));
  EXPECT_THAT(ValuesOf(file.cell_data, "medit_reference"), ElementsAre(1, 2));
}

TEST_F(TetFormatsTest, MeditCountsThatDisagreeAreRefusedByTheirLine) {
  const std::string start = "MeshVersionFormatted 2\nDimension\n3\nVertices\n";
  const std::string rows = "0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
  const std::string tets = "Tetrahedra\n1\n1 2 3 4 0\nEnd\n";
  EXPECT_THAT(Read("good.mesh", start + "4\n" + rows + tets), IsOk());
  EXPECT_THAT(
      Read("long.mesh", start + "5\n" + rows + tets),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("line 10: row 4 of 5 Vertices")));
  EXPECT_THAT(Read("short.mesh", start + "3\n" + rows + tets),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("more rows follow")));
  EXPECT_THAT(Read("prisms.mesh", start + "4\n" + rows + "Prisms\n1\n1 2 3 4 1 2 0\n" + tets),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 Prisms")));
}

TEST_F(TetFormatsTest, TetgenAttributesMarkersAndRegionAreKept) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TwoTets("tetgen.ele")));
  EXPECT_THAT(ValuesOf(file.cell_data, "tetgen_region"), ElementsAre(7, 9));
  EXPECT_THAT(ValuesOf(file.point_data, "tetgen_attribute_1"),
              ElementsAre(0.5, 1.5, 2.5, 3.5, 4.5));
  EXPECT_THAT(ValuesOf(file.point_data, "tetgen_marker"), ElementsAre(1, 1, 0, 0, 2));
}

TEST_F(TetFormatsTest, TetgenFileWithoutItsPartnerIsNotFound) {
  EXPECT_THAT(Read("alone.ele", BytesOfFile(TwoTets("tetgen.ele"))),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("alone.node")));
}

TEST_F(TetFormatsTest, TetgenRowsBeyondTheAnnouncedOnesAreRefused) {
  Write("more.node", BytesOfFile(TwoTets("tetgen.node")));
  EXPECT_THAT(
      Read("more.ele", "1 4 0\n1 1 2 3 4\n2 2 3 4 5\n"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("announces 1 rows, 2 follow")));
}

TEST_F(TetFormatsTest, TetsThatAreAllNegativeAreTurnedAndCounted) {
  Write("turned.node", BytesOfFile(TwoTets("tetgen.node")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, Read("turned.ele", "2 4 0\n1 2 1 3 4\n2 3 2 4 5\n"));
  EXPECT_EQ(file.reoriented_tets, 2);
  EXPECT_GT(TetVolumes(file.mesh.positions(), file.mesh.tets()).minCoeff(), 0);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile mixed,
                       Read("turned.ele", "2 4 0\n1 2 1 3 4\n2 2 3 4 5\n"));
  EXPECT_EQ(mixed.reoriented_tets, 0);
  EXPECT_LT(TetVolumes(mixed.mesh.positions(), mixed.mesh.tets()).minCoeff(), 0);
}

TEST_F(TetFormatsTest, FormatBehindAnotherEndingIsNamedInOneLine) {
  const std::string gmsh = BytesOfFile(TwoTets("gmsh41_ascii.msh"));
  for (const char* name : {"a.mesh", "a.vtk", "a.vtu"}) {
    EXPECT_THAT(Read(name, gmsh), StatusIs(absl::StatusCode::kInvalidArgument,
                                           AllOf(HasSubstr(name), HasSubstr("it is a Gmsh mesh"))));
  }
  EXPECT_THAT(Read("a.msh", BytesOfFile(TwoTets("medit.mesh"))),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it is a MEDIT mesh")));
  EXPECT_THAT(Read("a.node", BytesOfFile(TwoTets("legacy_ascii.vtk"))),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it is a legacy VTK file")));
  EXPECT_THAT(Read("a.txt", gmsh), StatusIs(absl::StatusCode::kInvalidArgument,
                                            HasSubstr("not one of the supported ones")));
  EXPECT_THAT(Read("a.stl", "solid a\nendsolid a\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("a mesh of tets is needed")));
}

TEST_F(TetFormatsTest, ContentDistinguishesTheVtkFormats) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile legacy, ReadTetMesh(TwoTets("legacy_ascii.vtk")));
  ASSERT_THAT(WriteTetMesh(Path("two.vtu"), legacy), IsOk());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile xml, Read("xml.vtk", BytesOfFile(Path("two.vtu"))));
  EXPECT_EQ(xml.mesh.positions(), legacy.mesh.positions());
  EXPECT_EQ(xml.mesh.tets(), legacy.mesh.tets());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile text,
                       Read("text.vtu", BytesOfFile(TwoTets("legacy_ascii.vtk"))));
  EXPECT_EQ(text.mesh.tets(), legacy.mesh.tets());
}

TEST_F(TetFormatsTest, FormatsThatAreNotReadAreNamed) {
  const std::string lfs =
      "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 1234567\n";
  const std::string binary_medit("\1\0\0\0\2\0\0\0\3\0\0\0", 12);
  const std::string ansys = "       1 0.1000000000000E+01 0.2500000000000E+00\n       2\n";
  struct Case {
    const char* name;
    std::string contents;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"a.mesh", "MFEM mesh v1.0\n\ndimension\n3\n", "it is an MFEM mesh; save it"},
      {"a.mesh", binary_medit, "it is a binary MEDIT mesh (.meshb); save it as ASCII"},
      {"a.meshb", binary_medit, "it is a binary MEDIT mesh (.meshb); save it as ASCII"},
      {"a.node", ansys, "it is an ANSYS file"},
      {"a.node", "/COM,ANSYS RELEASE 19\n", "it is an ANSYS file"},
      {"a.vtu", lfs, "run \"git lfs pull\""},
      {"a.vtk", lfs, "run \"git lfs pull\""},
      {"a.msh", lfs, "run \"git lfs pull\""},
      {"a.mesh", lfs, "run \"git lfs pull\""},
      {"a.ele", lfs, "run \"git lfs pull\""}};
  for (const Case& one : cases) {
    EXPECT_THAT(Read(one.name, one.contents),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr(one.name), HasSubstr(one.message))));
  }
  Write("a.stl", lfs);
  EXPECT_THAT(ReadTriangleMesh(Path("a.stl")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("git lfs pull")));
}

// Three programs write Gmsh 2.2 in binary so. What Gmsh makes of it is what is read.
TEST_F(TetFormatsTest, GmshBinaryNeedsNoLineBreakBeforeItsLastMark) {
  std::string bytes = BytesOfFile(TwoTets("gmsh22_binary.msh"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile with_break, Read("with.msh", bytes));
  const size_t mark = bytes.rfind("\n$EndElements");
  ASSERT_NE(mark, std::string::npos);
  bytes.erase(mark, 1);
  bytes.resize(bytes.find("$EndElements") + std::string("$EndElements\n").size());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile without, Read("without.msh", bytes));
  EXPECT_EQ(without.mesh.positions(), with_break.mesh.positions());
  EXPECT_EQ(without.mesh.tets(), with_break.mesh.tets());
  bytes.resize(bytes.rfind("$EndElements") + 6);
  bytes.back() = '\1';
  EXPECT_THAT(Read("cut.msh", bytes),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it is truncated")));
}

TEST_F(TetFormatsTest, MeshOverTheMemoryLimitIsRefusedBeforeItIsTried) {
  MeshReadLimits limits;
  limits.max_memory_bytes = 1000;
  for (const char* name : {"gmsh41_binary.msh", "legacy_ascii.vtk", "medit.mesh", "tetgen.node"}) {
    EXPECT_THAT(ReadTetMesh(TwoTets(name), limits),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("max_memory_bytes")));
  }
  EXPECT_THAT(ReadTetMesh(TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu"), limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2238 points")));
}

// A full disk, played by a limit on the size of files.
TEST_F(TetFormatsTest, FullDiskKeepsTheOldMesh) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile small, ReadTetMesh(TwoTets("legacy_ascii.vtk")));
  ASSERT_THAT(WriteTetMesh(Path("mesh.vtu"), small), IsOk());
  const std::string old = BytesOfFile(Path("mesh.vtu"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile large,
                       ReadTetMesh(TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu")));
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit full{8192, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &full);
  const absl::Status status = WriteTetMesh(Path("mesh.vtu"), large);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("mesh.vtu")));
  EXPECT_EQ(BytesOfFile(Path("mesh.vtu")), old);
}

struct RealMesh {
  const char* path;
  int vertices;
  int tets;
  int boundary_facets;
};

// Figures from the SOURCE.md beside each, found with other programs.
TEST_F(TetFormatsTest, RealMeshesHaveTheirPublishedFigures) {
  for (const RealMesh& real :
       {RealMesh{"tet_ipc_armadillo13k/Armadillo13K.msh", 13230, 54985, 17296},
        RealMesh{"tet_mmg_tinybox/tinyBoxt.mesh", 11866, 63434, 4754},
        RealMesh{"tet_chaste_ellipsoid/ellipsoid_15811_elements.node", 3432, 15811, 3666},
        RealMesh{"tet_chaste_ellipsoid/ellipsoid_15811_elements.ele", 3432, 15811, 3666}}) {
    ASSERT_OK_AND_ASSIGN(const TetMeshFile file,
                         ReadTetMesh(TestDataPath(std::string("meshes/") + real.path)));
    EXPECT_EQ(file.mesh.num_vertices(), real.vertices) << real.path;
    EXPECT_EQ(file.mesh.num_tets(), real.tets) << real.path;
    EXPECT_EQ(BoundaryFacets(file.mesh).rows(), real.boundary_facets) << real.path;
    EXPECT_GT(TetVolumes(file.mesh.positions(), file.mesh.tets()).minCoeff(), 0) << real.path;
  }
}

TEST_F(TetFormatsTest, MmgBoxHasTheVolumeOfABox) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file,
                       ReadTetMesh(TestDataPath("meshes/tet_mmg_tinybox/tinyBoxt.mesh")));
  EXPECT_NEAR(TetVolumes(file.mesh.positions(), file.mesh.tets()).sum(), 5.0, 1e-9);
}

// All six of its elements carry the number 44, of which Gmsh by itself keeps one.
TEST_F(TetFormatsTest, ElementsThatShareANumberAreAllRead) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file,
                       ReadTetMesh(TestDataPath("meshes/tet_sofa_small_inverted/6_tetra_bad.msh")));
  EXPECT_EQ(file.mesh.num_vertices(), 17);
  EXPECT_EQ(file.mesh.num_tets(), 6);
  const Eigen::VectorXd volumes = TetVolumes(file.mesh.positions(), file.mesh.tets());
  EXPECT_EQ((volumes.array() < 0).count(), 1);
  EXPECT_EQ(file.reoriented_tets, 0);
}

TEST_F(TetFormatsTest, NothingIsLeftInTheFolderForTemporaryFiles) {
  const std::filesystem::path temporary = folder_ / "temporary";
  std::filesystem::create_directory(temporary);
  setenv("TMPDIR", temporary.c_str(), 1);
  EXPECT_THAT(ReadTetMesh(TwoTets("gmsh22_ascii.msh")), IsOk());
  EXPECT_THAT(ReadTetMesh(TwoTets("tetgen.node")), IsOk());
  unsetenv("TMPDIR");
  EXPECT_TRUE(std::filesystem::is_empty(temporary));
}

}  // namespace
}  // namespace tissueform
