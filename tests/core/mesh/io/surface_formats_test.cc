// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "core/mesh/io/triangle_mesh_io.h"
#include "tests/core/mesh/io/mesh_folder.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using tissueform::testing::BytesOfFile;
using tissueform::testing::IsOk;
using tissueform::testing::MeshFolder;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

// A closed tetrahedron; its coordinates survive single precision.
TriangleMesh Tetrahedron() {
  Positions positions(4, 3);
  positions << 0, 0, 0, 1.5, 0, 0.125, 0, 2.25, 0, 0.125, 0.25, 3;
  TriangleIndices triangles(4, 3);
  triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3;
  return *TriangleMesh::Create(positions, triangles);
}

TriangleMeshFile OnlySurface(const TriangleMesh& mesh) {
  return {.mesh = mesh, .point_data = {}, .cell_data = {}};
}

// The corners of triangle f as places, which hold also where a format renumbers vertices.
Positions CornersOf(const TriangleMesh& mesh, Eigen::Index f) {
  Positions corners(3, 3);
  for (int k = 0; k < 3; ++k) corners.row(k) = mesh.positions().row(mesh.triangles()(f, k));
  return corners;
}

class SurfaceFolder : public MeshFolder {
 protected:
  absl::StatusOr<TriangleMeshFile> ReadSurface(const std::string& name,
                                               const std::string& contents) const {
    Write(name, contents);
    ::testing::internal::CaptureStderr();
    absl::StatusOr<TriangleMeshFile> file = ReadTriangleMesh(Path(name));
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), ::testing::IsEmpty());
    return file;
  }
  std::string Written(const std::string& ending) const {
    EXPECT_THAT(WriteTriangleMesh(Path("written" + ending), OnlySurface(Tetrahedron())), IsOk());
    return BytesOfFile(Path("written" + ending));
  }
};

class EverySurfaceFormatTest : public SurfaceFolder,
                               public ::testing::WithParamInterface<const char*> {};

TEST_P(EverySurfaceFormatTest, SurfaceComesBack) {
  Written(GetParam());
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file,
                       ReadTriangleMesh(Path(std::string("written") + GetParam())));
  const TriangleMesh expected = Tetrahedron();
  ASSERT_EQ(file.mesh.num_vertices(), 4);
  ASSERT_EQ(file.mesh.num_triangles(), 4);
  for (Eigen::Index f = 0; f < 4; ++f) {
    EXPECT_EQ(CornersOf(file.mesh, f), CornersOf(expected, f)) << f;
  }
  EXPECT_EQ(file.split_polygons, 0);
}

TEST_P(EverySurfaceFormatTest, SaysThatItIsNoMedicalDevice) {
  EXPECT_THAT(Written(GetParam()), HasSubstr("not a medical device"));
}

TEST_P(EverySurfaceFormatTest, TruncatedAnywhereIsRefusedOrHoldsOnlyWholeFaces) {
  const std::string whole = Written(GetParam());
  int refused = 0;
  for (size_t tenth = 0; tenth < 10; ++tenth) {
    const absl::StatusOr<TriangleMeshFile> file =
        ReadSurface(std::string("cut") + GetParam(), whole.substr(0, whole.size() * tenth / 10));
    if (file.ok()) continue;
    ++refused;
    EXPECT_THAT(file, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cut."))) << tenth;
  }
  // OBJ announces no counts: a file that ends after some faces is a whole smaller one.
  EXPECT_GE(refused, std::string(GetParam()) == ".obj" ? 5 : 10);
}

TEST_P(EverySurfaceFormatTest, ChangedBytesNeverEndTheProgram) {
  const std::string whole = Written(GetParam());
  std::mt19937 generator(4);
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    std::string contents = whole;
    for (int change = 0; change < 3; ++change) {
      contents[generator() % contents.size()] = static_cast<char>(generator());
    }
    if (!ReadSurface(std::string("changed") + GetParam(), contents).ok()) ++refused;
  }
  // Nearly every byte of a binary STL is one of a coordinate, and another number there is no
  // damage.
  EXPECT_GT(refused, std::string(GetParam()) == ".stl" ? 0 : 5);
}

TEST_P(EverySurfaceFormatTest, AnotherFormatBehindTheEndingIsNamed) {
  const std::string gmsh = BytesOfFile(TestDataPath("meshes/two_tets/gmsh41_ascii.msh"));
  EXPECT_THAT(ReadSurface(std::string("a") + GetParam(), gmsh),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("it is a Gmsh mesh"), HasSubstr(GetParam()))));
}

INSTANTIATE_TEST_SUITE_P(Endings, EverySurfaceFormatTest,
                         ::testing::Values(".vtp", ".stl", ".ply", ".obj", ".off"),
                         [](const auto& test) { return std::string(test.param + 1); });

using SurfaceFormatsTest = SurfaceFolder;

TEST_F(SurfaceFormatsTest, VtpKeepsArraysOfPointsAndTriangles) {
  TriangleMeshFile file = OnlySurface(Tetrahedron());
  file.point_data.push_back({"anatomy", 1, std::vector<int32_t>{1, 2, 3, 4}});
  file.cell_data.push_back({"stiffness", 1, std::vector<double>{1e3, 2e3, 3e3, 4e3}});
  ASSERT_THAT(WriteTriangleMesh(Path("a.vtp"), file), IsOk());
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile read, ReadTriangleMesh(Path("a.vtp")));
  ASSERT_THAT(read.point_data, SizeIs(1));
  EXPECT_TRUE(read.point_data[0].values == file.point_data[0].values);
  ASSERT_THAT(read.cell_data, SizeIs(1));
  EXPECT_TRUE(read.cell_data[0].values == file.cell_data[0].values);
}

TEST_F(SurfaceFormatsTest, StlIsBinaryAndSaysThatItIsNoMedicalDevice) {
  ASSERT_THAT(WriteTriangleMesh(Path("a.stl"), OnlySurface(Tetrahedron())), IsOk());
  const std::string contents = BytesOfFile(Path("a.stl"));
  EXPECT_EQ(contents.size(), 80U + 4U + 4U * 50U);
  EXPECT_THAT(contents.substr(0, 80), HasSubstr("not a medical device"));
}

TEST_F(SurfaceFormatsTest, ArraysThatAFormatWouldLoseAreRefused) {
  TriangleMeshFile file = OnlySurface(Tetrahedron());
  file.point_data.push_back({"anatomy", 1, std::vector<int32_t>{1, 2, 3, 4}});
  EXPECT_THAT(WriteTriangleMesh(Path("a.stl"), file),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("only .vtp keeps arrays")));
  EXPECT_THAT(WriteTriangleMesh(Path("a.vtu"), file),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("ending")));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(SurfaceFormatsTest, ObjFacesWithNormalsAndTexturesKeepTheirVertices) {
  ASSERT_OK_AND_ASSIGN(
      const TriangleMeshFile file,
      ReadSurface("a.obj",
                  "# by hand\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\n"
                  "vn 0 0 1\nvn 0 1 0\ng part\nusemtl skin\ns 1\nf 1/1/1 2/2/1 3/1/2\nf -4//1 "
                  "-2//2 -1//1\n"));
  EXPECT_EQ(file.mesh.num_vertices(), 4);
  TriangleIndices expected(2, 3);
  expected << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(file.mesh.triangles(), expected);
}

TEST_F(SurfaceFormatsTest, PolygonsAreSplitAndTheirArraysFollow) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty "
      "double z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 "
      "0\n1 1 0\n0 1 0\n0 0 1\n4 0 1 2 3\n3 0 1 4\n";
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file, ReadSurface("a.ply", ply));
  TriangleIndices expected(3, 3);
  expected << 0, 1, 2, 0, 2, 3, 0, 1, 4;
  EXPECT_EQ(file.mesh.triangles(), expected);
  EXPECT_EQ(file.split_polygons, 1);
  ASSERT_OK_AND_ASSIGN(
      const TriangleMeshFile off,
      ReadSurface("a.off", "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n4 0 1 2 3\n3 0 1 4\n"));
  EXPECT_EQ(off.mesh.triangles(), expected);
}

TEST_F(SurfaceFormatsTest, VtpCellArraysAreSpreadOverSplitPolygons) {
  ASSERT_OK_AND_ASSIGN(
      const TriangleMeshFile file,
      ReadSurface("a.vtp",
                  R"(<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData>
<Piece NumberOfPoints="4" NumberOfPolys="1" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0">
<CellData><DataArray type="Int32" Name="part" format="ascii">7</DataArray></CellData>
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points>
<Polys><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray></Polys>
</Piece></PolyData></VTKFile>)"));
  ASSERT_THAT(file.cell_data, SizeIs(1));
  EXPECT_EQ(ToDoubles(file.cell_data[0]), (std::vector<double>{7, 7}));
}

// 80 bytes of anything, the count, then 50 bytes a triangle.
TEST_F(SurfaceFormatsTest, BinaryStlIsReadAndItsLengthChecked) {
  std::string stl(84 + 50, '\0');
  std::memcpy(stl.data(), "solid pretender", 15);
  stl[80] = 1;
  const std::vector<float> numbers = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::memcpy(stl.data() + 84, numbers.data(), numbers.size() * sizeof(float));
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file, ReadSurface("a.stl", stl));
  EXPECT_EQ(file.mesh.num_vertices(), 3);
  EXPECT_EQ(file.mesh.num_triangles(), 1);
  stl[0] = 'b';
  stl[80] = 2;
  EXPECT_THAT(ReadSurface("a.stl", stl), StatusIs(absl::StatusCode::kInvalidArgument,
                                                  HasSubstr("truncated or not an STL file")));
}

// One triangle as each format writes it, with a line of comment or a header.
struct Commented {
  std::string name;
  std::string before;
  std::string after;
};

std::vector<Commented> CommentedFiles() {
  std::string binary(84 + 50 - 34, '\0');
  binary[80 - 34] = 1;
  const std::vector<float> numbers = {0, 0, 1, 1, 2, 3, 2, 2, 3, 1, 3, 3};
  std::memcpy(binary.data() + 84 - 34, numbers.data(), numbers.size() * sizeof(float));
  return {
      {"ascii.stl", "solid 3D Slicer output. ",
       "\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 2 2 3\nvertex 1 3 3\nendloop\n"
       "endfacet\nendsolid\n"},
      {"binary.stl", "Visualization output now ", binary},
      {"a.ply", "ply\nformat ascii 1.0\ncomment 3D Slicer output. ",
       "\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float "
       "nx\nproperty float ny\nproperty float nz\nelement face 1\nproperty list uchar int "
       "vertex_indices\nend_header\n1 2 3 0.5 0.25 1\n2 2 3 0 0 1\n1 3 3 0 0 1\n3 0 1 2\n"},
      {"a.obj", "# 3D Slicer output. ", "\nv 1 2 3\nv 2 2 3\nv 1 3 3\nf 1 2 3\n"},
  };
}

TEST_F(SurfaceFormatsTest, ConvertsFilesThatStateRasToLps) {
  for (const Commented& file : CommentedFiles()) {
    for (const auto& [words, space, sign] : {std::tuple("SPACE=RAS", FileSpace::kRas, -1.0),
                                             std::tuple("SPACE=LPS", FileSpace::kLps, 1.0),
                                             std::tuple("SPACE=any", FileSpace::kUnstated, 1.0)}) {
      ASSERT_OK_AND_ASSIGN(const TriangleMeshFile read,
                           ReadSurface(file.name, file.before + words + file.after));
      EXPECT_EQ(read.space, space) << file.name;
      Positions expected(3, 3);
      expected << sign, sign * 2, 3, sign * 2, sign * 2, 3, sign, sign * 3, 3;
      EXPECT_EQ(CornersOf(read.mesh, 0), expected) << file.name << words;
      const Attribute* const normals = FindAttribute(read.point_data, "Normals");
      ASSERT_EQ(normals != nullptr, file.name == "a.ply");
      if (normals == nullptr) continue;
      EXPECT_EQ(ToDoubles(*normals)[0], sign * 0.5);
      EXPECT_EQ(ToDoubles(*normals)[1], sign * 0.25);
      EXPECT_EQ(ToDoubles(*normals)[2], 1);
    }
  }
}

TEST_F(SurfaceFormatsTest, OnlyAHeaderStatesTheSpace) {
  for (const char* name : {"o SPACE=RAS", "g SPACE=RAS"}) {
    ASSERT_OK_AND_ASSIGN(
        const TriangleMeshFile file,
        ReadSurface("a.obj", std::string(name) + "\nv 1 2 3\nv 2 2 3\nv 1 3 3\nf 1 2 3\n"));
    EXPECT_EQ(file.space, FileSpace::kUnstated);
    EXPECT_EQ(file.mesh.positions()(0, 0), 1);
  }
}

TEST_F(SurfaceFormatsTest, FaceWithoutItsVertexIsRefused) {
  EXPECT_THAT(ReadSurface("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("refers to")));
  EXPECT_THAT(ReadSurface("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("refers to")));
  EXPECT_THAT(ReadSurface("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("a.off"),
                             HasSubstr("a face refers to a vertex that is not there"))));
}

TEST_F(SurfaceFormatsTest, RefusesATetMeshAsASurface) {
  EXPECT_THAT(ReadTriangleMesh(TestDataPath("meshes/two_tets/gmsh41_ascii.msh")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("a surface is needed")));
}

}  // namespace
}  // namespace tissueform
