// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// What must not be taken for a mesh, and what is said about it.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tissueform::testing::Bar;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

constexpr char kTongue[] = "meshes/tet_sofa_tongue/volumetricTongue.vtu";

// One tet with a point array and a cell array, as text in which tests change single words.
constexpr char kOneTet[] =
    R"(<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<PointData><DataArray type="Int32" Name="anatomy" format="ascii">0 1 2 3</DataArray></PointData>
<CellData><DataArray type="Float64" Name="pa" format="ascii">3000</DataArray></CellData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>)";

class DamagedMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) / "damaged_mesh_test" / info->name();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Reads `contents` as a mesh; nothing may appear on stderr, regardless of the result.
  absl::StatusOr<TetMeshFile> Read(const std::string& contents) {
    const std::string path = (folder_ / "mesh.vtu").string();
    std::ofstream(path, std::ios::binary) << contents;
    ::testing::internal::CaptureStderr();
    absl::StatusOr<TetMeshFile> file = ReadTetMesh(path);
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
    return file;
  }

  absl::StatusOr<TetMeshFile> ReadWith(const std::string& word, const std::string& replacement) {
    const std::string contents = absl::StrReplaceAll(kOneTet, {{word, replacement}});
    EXPECT_NE(contents, kOneTet) << word;
    return Read(contents);
  }

  // A file as this program writes it: compressed, several blocks.
  std::string CompressedBar() {
    const TetMesh bar = Bar({8, 8, 16}, 1.0, 0.1);
    const std::vector<double> pa(static_cast<size_t>(bar.num_tets()), 3000);
    const std::string path = (folder_ / "bar.vtu").string();
    EXPECT_THAT(WriteTetMesh(path, {.mesh = bar, .point_data = {}, .cell_data = {{"pa", 1, pa}}}),
                IsOk());
    return testing::BytesOfFile(path);
  }

  std::filesystem::path folder_;
};

auto IsRefused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr("mesh.vtu"), HasSubstr(why)));
}

TEST_F(DamagedMeshTest, TheUndamagedTextIsRead) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, Read(kOneTet));
  EXPECT_EQ(file.mesh.num_tets(), 1);
  EXPECT_EQ(file.point_data.size(), 1U);
  EXPECT_EQ(file.cell_data.size(), 1U);
}

TEST_F(DamagedMeshTest, AcceptsFieldDataOfAnyLength) {
  ASSERT_OK_AND_ASSIGN(
      const TetMeshFile file,
      ReadWith("<UnstructuredGrid>",
               R"(<UnstructuredGrid><FieldData><DataArray type="Float64" Name="TimeValue"
NumberOfTuples="1" format="ascii">0.5</DataArray><DataArray type="Int32" Name="three"
NumberOfTuples="3" format="ascii">7 8 9</DataArray></FieldData>)"));
  EXPECT_EQ(file.mesh.num_tets(), 1);
}

TEST_F(DamagedMeshTest, MissingFileIsNotFound) {
  EXPECT_THAT(ReadTetMesh((folder_ / "missing.vtu").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing.vtu")));
}

TEST_F(DamagedMeshTest, FolderIsRefused) {
  EXPECT_THAT(ReadTetMesh(folder_.string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("folder")));
}

TEST_F(DamagedMeshTest, AsciiFileTruncatedAnywhereIsRefused) {
  const std::string whole = testing::BytesOfFile(TestDataPath(kTongue));
  for (int tenths = 0; tenths < 10; ++tenths) {
    EXPECT_THAT(Read(whole.substr(0, whole.size() * tenths / 10)), IsRefused("")) << tenths;
  }
}

TEST_F(DamagedMeshTest, CompressedFileTruncatedAnywhereIsRefused) {
  const std::string whole = CompressedBar();
  for (int tenths = 0; tenths < 10; ++tenths) {
    EXPECT_THAT(Read(whole.substr(0, whole.size() * tenths / 10)), IsRefused("")) << tenths;
  }
}

TEST_F(DamagedMeshTest, OtherFormatsBehindTheEndingAreNamed) {
  const std::string gmsh =
      testing::BytesOfFile(TestDataPath("meshes/tet_sofa_small_inverted/6_tetra_bad.msh"));
  EXPECT_THAT(Read(gmsh), IsRefused("Gmsh"));
  EXPECT_THAT(Read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), IsRefused("OBJ"));
  EXPECT_THAT(Read("# vtk DataFile Version 3.0\nmesh\nASCII\n"),
              IsRefused("another data set than an unstructured"));
  EXPECT_THAT(Read("   \n\t"), IsRefused("not XML"));
  EXPECT_THAT(Read(""), IsRefused("empty"));
}

TEST_F(DamagedMeshTest, RefusesXmlThatIsNotAnUnstructuredGrid) {
  EXPECT_THAT(Read("<html><body>404</body></html>"), IsRefused("not a .vtu file"));
  EXPECT_THAT(ReadWith("UnstructuredGrid", "PolyData"), IsRefused("VTK XML polygons (.vtp)"));
  EXPECT_THAT(ReadWith("UnstructuredGrid", "ImageData"), IsRefused("not a .vtu file"));
  EXPECT_THAT(Read("<"), IsRefused("not a .vtu file"));
}

TEST_F(DamagedMeshTest, RandomBytesAreRefused) {
  std::mt19937 generator(1);
  for (int round = 0; round < 20; ++round) {
    std::string bytes(2000, '\0');
    for (char& byte : bytes) byte = static_cast<char>(generator());
    EXPECT_THAT(Read(bytes), Not(IsOk()));
    bytes[0] = '<';
    EXPECT_THAT(Read(bytes), Not(IsOk()));
  }
}

TEST_F(DamagedMeshTest, ChangedBytesNeverEndTheProgram) {
  const std::string whole = CompressedBar();
  std::mt19937 generator(2);
  int refused = 0;
  for (int round = 0; round < 200; ++round) {
    std::string contents = whole;
    for (int change = 0; change < 3; ++change) {
      contents[generator() % contents.size()] = static_cast<char>(generator());
    }
    if (!Read(contents).ok()) ++refused;
  }
  EXPECT_GT(refused, 100);  // zlib's checksums and the header's counts notice most
}

TEST_F(DamagedMeshTest, BrokenArmadilloIsRefused) {
  EXPECT_THAT(
      ReadTetMesh(TestDataPath(
          "meshes/tet_sofa_armadillo_ok_and_broken/Armadillo_Tetra_4406_for_test_broken.vtu")),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("than the header says")));
}

TEST_F(DamagedMeshTest, HeaderWithOtherCountsThanTheArraysIsRefused) {
  EXPECT_THAT(ReadWith("NumberOfPoints=\"4\"", "NumberOfPoints=\"5\""), IsRefused("fewer values"));
  EXPECT_THAT(ReadWith("NumberOfPoints=\"4\"", "NumberOfPoints=\"3\""), IsRefused("more values"));
  EXPECT_THAT(ReadWith("NumberOfCells=\"1\"", "NumberOfCells=\"2\""), IsRefused("fewer values"));
  EXPECT_THAT(ReadWith("NumberOfCells=\"1\"", "NumberOfCells=\"0\""), IsRefused(""));
  EXPECT_THAT(ReadWith("NumberOfPoints=\"4\"", ""), IsRefused("no NumberOfPoints"));
}

TEST_F(DamagedMeshTest, CountsThatNoFileOfThatSizeHoldsAreRefusedBeforeMemoryIsReserved) {
  for (const char* count : {"-1", "2147483647", "9000000000000000000"}) {
    EXPECT_THAT(ReadWith("NumberOfPoints=\"4\"", absl::StrCat("NumberOfPoints=\"", count, "\"")),
                IsRefused("cannot hold"));
    EXPECT_THAT(ReadWith("NumberOfCells=\"1\"", absl::StrCat("NumberOfCells=\"", count, "\"")),
                IsRefused("cannot hold"));
  }
  EXPECT_THAT(ReadWith(">4<", ">2000000000<"), IsRefused("cannot hold"));
}

TEST_F(DamagedMeshTest, ArrayShorterOrLongerThanItsMeshIsRefusedByName) {
  EXPECT_THAT(ReadWith("Name=\"anatomy\" format=\"ascii\">0 1 2 3<",
                       "Name=\"anatomy\" format=\"ascii\">0 1 2<"),
              IsRefused("\"anatomy\" holds fewer values"));
  EXPECT_THAT(ReadWith("Name=\"anatomy\" format=\"ascii\">0 1 2 3<",
                       "Name=\"anatomy\" format=\"ascii\">0 1 2 3 4<"),
              IsRefused("\"anatomy\" holds more values"));
  EXPECT_THAT(ReadWith(">3000<", "><"), IsRefused("\"pa\" holds fewer values"));
  EXPECT_THAT(ReadWith(">3000<", ">3000 4000<"), IsRefused("\"pa\" holds more values"));
}

TEST_F(DamagedMeshTest, ShortCellArrayWithoutPointDataIsRefused) {
  const std::string contents = absl::StrReplaceAll(
      kOneTet,
      {{R"(<PointData><DataArray type="Int32" Name="anatomy" format="ascii">0 1 2 3</DataArray></PointData>)",
        ""},
       {">3000<", "><"}});
  EXPECT_THAT(Read(contents), IsRefused("\"pa\" holds fewer values"));
}

TEST_F(DamagedMeshTest, ArrayHeadersThatVtkTrustsAreChecked) {
  EXPECT_THAT(ReadWith("Name=\"pa\"", ""), IsRefused("no name"));
  EXPECT_THAT(ReadWith("Name=\"pa\"", "Name=\"\""), IsRefused("name"));
  EXPECT_THAT(ReadWith("Name=\"pa\"", "Name=\"pa\" NumberOfComponents=\"2000000000\""),
              IsRefused("NumberOfComponents"));
  EXPECT_THAT(ReadWith("Name=\"pa\" format=\"ascii\">3000</DataArray>",
                       "Name=\"pa\" format=\"ascii\">3000</DataArray>"
                       "<DataArray type=\"Float64\" Name=\"pa\" format=\"ascii\">4</DataArray>"),
              IsRefused("two arrays named \"pa\""));
}

TEST_F(DamagedMeshTest, SeveralPiecesAreRefused) {
  EXPECT_THAT(
      ReadWith("</Piece>", "</Piece><Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"></Piece>"),
      IsRefused("several pieces"));
}

TEST_F(DamagedMeshTest, NamesTheTypeOfACellThatIsNotATet) {
  EXPECT_THAT(ReadWith(">10<", ">12<"), IsRefused("cell 0 is a vtkHexahedron (type 12)"));
  EXPECT_THAT(ReadWith(">10<", ">14<"), IsRefused("cell 0 is a vtkPyramid (type 14)"));
  EXPECT_THAT(ReadWith(">10<", ">78<"), IsRefused("cell 0 is a"));
  EXPECT_THAT(ReadWith(">10<", ">200<"), IsRefused("cell 0 is a"));
}

TEST_F(DamagedMeshTest, RefusesAMeshOfFacesOnly) {
  EXPECT_THAT(ReadWith(">10<", ">9<"),
              IsRefused("no tets: its 1 cells are points, lines or faces"));
}

TEST_F(DamagedMeshTest, TetWithAnotherNumberOfCornersIsRefused) {
  EXPECT_THAT(Read(absl::StrReplaceAll(kOneTet, {{"connectivity\" format=\"ascii\">0 1 2 3<",
                                                  "connectivity\" format=\"ascii\">0 1 2<"},
                                                 {">4<", ">3<"}})),
              IsRefused("tet 0 has 3 corners"));
}

TEST_F(DamagedMeshTest, VertexThatDoesNotExistIsNamed) {
  EXPECT_THAT(ReadWith("connectivity\" format=\"ascii\">0 1 2 3<",
                       "connectivity\" format=\"ascii\">0 1 2 4<"),
              IsRefused("tet 0 refers to vertex 4"));
  EXPECT_THAT(ReadWith("connectivity\" format=\"ascii\">0 1 2 3<",
                       "connectivity\" format=\"ascii\">0 1 2 -1<"),
              IsRefused("tet 0 refers to vertex -1"));
}

TEST_F(DamagedMeshTest, ConnectivityOfAnotherLengthIsRefused) {
  EXPECT_THAT(ReadWith("connectivity\" format=\"ascii\">0 1 2 3<",
                       "connectivity\" format=\"ascii\">0 1 2<"),
              IsRefused("\"connectivity\" holds fewer"));
  EXPECT_THAT(ReadWith("connectivity\" format=\"ascii\">0 1 2 3<",
                       "connectivity\" format=\"ascii\">0 1 2 3 0<"),
              IsRefused("\"connectivity\" holds more"));
}

}  // namespace
}  // namespace tissueform
