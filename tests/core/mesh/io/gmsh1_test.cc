// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_replace.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/core/mesh/io/mesh_folder.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// Gmsh's first format: $NOD and $ELM, vertices and elements under any numbers.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::BytesOfFile;
using tissueform::testing::MeshFolder;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

std::string Sofa(const std::string& name) { return TestDataPath("meshes/tet_sofa_gmsh1/" + name); }

// The file read word by word, by nothing of ours and not by Gmsh.
struct PlainReading {
  std::map<int, Eigen::RowVector3d> places;
  std::map<int, std::array<int, 4>> tets;  // by their numbers: corners
  std::map<int, int> physical;
  int other_elements = 0;
};

PlainReading ReadPlainly(const std::string& path) {
  PlainReading reading;
  std::ifstream words(path);
  std::string word;
  int count = 0;
  words >> word >> count;
  for (int i = 0; i < count; ++i) {
    int number = 0;
    Eigen::RowVector3d place;
    words >> number >> place[0] >> place[1] >> place[2];
    reading.places[number] = place;
  }
  words >> word >> word >> count;  // $ENDNOD $ELM
  for (int i = 0; i < count; ++i) {
    int number = 0;
    int type = 0;
    int physical = 0;
    int entity = 0;
    int corners = 0;
    words >> number >> type >> physical >> entity >> corners;
    std::vector<int> nodes(static_cast<size_t>(corners));
    for (int& node : nodes) words >> node;
    if (type == 4) {
      reading.tets[number] = {nodes[0], nodes[1], nodes[2], nodes[3]};
      reading.physical[number] = physical;
    } else {
      ++reading.other_elements;
    }
  }
  words >> word;
  EXPECT_EQ(word, "$ENDELM");
  return reading;
}

class Gmsh1Test : public MeshFolder, public ::testing::WithParamInterface<const char*> {};

// Also when the file counts corners the other way round, as both do: the last two are then swapped.
TEST_P(Gmsh1Test, SofasMeshEqualsAPlainReadingOfIt) {
  const PlainReading plain = ReadPlainly(Sofa(GetParam()));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(Sofa(GetParam())));
  ASSERT_EQ(file.mesh.num_tets(), static_cast<int>(plain.tets.size()));
  EXPECT_EQ(file.left_out_cells, plain.other_elements);
  const std::array<int, 4> order =
      file.reoriented_tets == 0 ? std::array{0, 1, 2, 3} : std::array{0, 1, 3, 2};
  const Attribute* const physical = FindAttribute(file.cell_data, "gmsh_physical");
  ASSERT_NE(physical, nullptr);
  Eigen::Index t = 0;
  for (const auto& [number, corners] : plain.tets) {
    for (size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(file.mesh.positions().row(file.mesh.tets()(t, order[k])),
                plain.places.at(corners[k]))
          << "tet " << number;
    }
    EXPECT_EQ(ToDoubles(*physical)[static_cast<size_t>(t)], plain.physical.at(number));
    ++t;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, Gmsh1Test, ::testing::Values("cylinder.msh", "liver2.msh"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           return name.substr(0, name.find('.'));
                         });

using Gmsh1FormTest = MeshFolder;

TEST_F(Gmsh1FormTest, RegionsOfTetsAreKept) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file,
                       ReadTetMesh(TestDataPath("meshes/two_tets/gmsh1_ascii.msh")));
  EXPECT_THAT(ToDoubles(*FindAttribute(file.cell_data, "gmsh_physical")), ElementsAre(7, 9));
  EXPECT_THAT(ToDoubles(*FindAttribute(file.cell_data, "gmsh_entity")), ElementsAre(1, 2));
}

TEST_F(Gmsh1FormTest, RegionZeroAndElementsThatShareANumberAreRead) {
  const std::string text = absl::StrReplaceAll(
      BytesOfFile(TestDataPath("meshes/two_tets/gmsh1_ascii.msh")),
      {{"1 4 7 1 4 1 2 3 4", "44 4 0 0 4 1 2 3 4"}, {"2 4 9 2 4 2 3 4 5", "44 4 0 0 4 2 3 4 5"}});
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, Read("same.msh", text));
  EXPECT_EQ(file.mesh.num_tets(), 2);
  EXPECT_EQ(FindAttribute(file.cell_data, "gmsh_physical"), nullptr);
}

TEST_F(Gmsh1FormTest, ElementsThatShareANumberMayBeIndented) {
  const std::string text =
      absl::StrReplaceAll(BytesOfFile(TestDataPath("meshes/two_tets/gmsh1_ascii.msh")),
                          {{"1 4 7 1 4 1 2 3 4", " 44 4 0 0 4 1 2 3 4"},
                           {"2 4 9 2 4 2 3 4 5", "\t44 4 0 0 4 2 3 4 5"}});
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, Read("same.msh", text));
  EXPECT_EQ(file.mesh.num_tets(), 2);
}

TEST_F(Gmsh1FormTest, OtherSolidsAreNamedAndFacesLeftOut) {
  const std::string nodes =
      "$NOD\n6\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n15 1 0 1\n16 0 1 1\n$ENDNOD\n";
  EXPECT_THAT(
      Read("prism.msh", nodes + "$ELM\n2\n1 4 1 1 4 1 2 3 4\n2 6 1 1 6 1 2 3 4 15 16\n$ENDELM\n"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("Prism")));
  ASSERT_OK_AND_ASSIGN(
      const TetMeshFile file,
      Read("face.msh", nodes + "$ELM\n2\n7 2 1 1 3 4 15 16\n8 4 1 1 4 1 2 3 4\n$ENDELM\n"));
  EXPECT_EQ(file.left_out_cells, 1);
  EXPECT_EQ(file.mesh.num_vertices(), 4);
}

TEST_F(Gmsh1FormTest, NamesTheMissingPartOfADamagedFile) {
  const std::string good = BytesOfFile(TestDataPath("meshes/two_tets/gmsh1_ascii.msh"));
  const std::string cut = good.substr(0, good.find("$ENDELM"));
  EXPECT_THAT(Read("cut.msh", cut),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("$ENDELM")));
  const std::string more = absl::StrReplaceAll(good, {{"$NOD\n5\n", "$NOD\n50\n"}});
  ASSERT_NE(more, good);
  EXPECT_THAT(Read("more.msh", more),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("count of nodes")));
}

TEST_F(Gmsh1FormTest, ElementOfAnotherLengthOrWithoutItsVertexIsRefused) {
  const std::string good = BytesOfFile(TestDataPath("meshes/two_tets/gmsh1_ascii.msh"));
  for (const char* line : {"2 4 9 2 3 2 3 4", "2 4 9 2 5 2 3 4 5 1", "2 4 9 2 4 2 3 4 99"}) {
    EXPECT_THAT(Read("bad.msh", absl::StrReplaceAll(good, {{"2 4 9 2 4 2 3 4 5", line}})),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bad.msh")))
        << line;
  }
}

}  // namespace
}  // namespace tissueform
