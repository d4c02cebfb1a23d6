// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/tet_mesh_io.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::Bar;
using tissueform::testing::IsOk;
using tissueform::testing::SingleTet;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

// A folder of its own for every test.
class TetMeshIoTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) / "tet_mesh_io_test" / info->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  std::vector<std::string> FilesLeft() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  std::filesystem::path folder_;
};

TetMeshFile OnlyMesh(const TetMesh& mesh) {
  return {.mesh = mesh, .point_data = {}, .cell_data = {}};
}

template <typename T>
std::vector<T> Extremes(Eigen::Index count) {
  std::vector<T> values(static_cast<size_t>(count), T{1});
  values.front() = std::numeric_limits<T>::lowest();
  values.back() = std::numeric_limits<T>::max();
  return values;
}

template <typename... T>
std::vector<Attribute> OneOfEach(Eigen::Index count) {
  std::vector<Attribute> attributes;
  (attributes.push_back({"array " + std::to_string(attributes.size()), 1, Extremes<T>(count)}),
   ...);
  return attributes;
}

std::vector<Attribute> EveryType(Eigen::Index count) {
  return OneOfEach<int8_t, uint8_t, int16_t, uint16_t, int32_t, uint32_t, int64_t, uint64_t, float,
                   double>(count);
}

void ExpectEqual(const std::vector<Attribute>& read, const std::vector<Attribute>& written) {
  ASSERT_EQ(read.size(), written.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].name, written[i].name);
    EXPECT_EQ(read[i].components, written[i].components);
    EXPECT_TRUE(read[i].values == written[i].values) << "type or value of " << read[i].name;
  }
}

TEST_F(TetMeshIoTest, MeshAndArraysOfEveryNumberTypeComeBackExactly) {
  const TetMesh bar = Bar({2, 3, 4}, 1.7, 0.2);
  TetMeshFile file{bar, EveryType(bar.num_vertices()), EveryType(bar.num_tets())};
  file.point_data.push_back(
      {"displacement", 3, std::vector<float>(static_cast<size_t>(3 * bar.num_vertices()), 0.1F)});
  ASSERT_THAT(WriteTetMesh(Path("bar.vtu"), file), IsOk());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile read, ReadTetMesh(Path("bar.vtu")));
  EXPECT_EQ(read.mesh.positions(), bar.positions());
  EXPECT_EQ(read.mesh.tets(), bar.tets());
  ExpectEqual(read.point_data, file.point_data);
  ExpectEqual(read.cell_data, file.cell_data);
}

TEST_F(TetMeshIoTest, ArraysLongerThanOneCompressedBlockComeBackExactly) {
  const TetMesh bar = Bar({12, 12, 24});
  TetMeshFile file = OnlyMesh(bar);
  std::vector<double> values(static_cast<size_t>(bar.num_tets()));
  for (size_t t = 0; t < values.size(); ++t) values[t] = 1.0 / (1.0 + static_cast<double>(t));
  file.cell_data.push_back({"values", 1, values});
  ASSERT_THAT(WriteTetMesh(Path("bar.vtu"), file), IsOk());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile read, ReadTetMesh(Path("bar.vtu")));
  EXPECT_EQ(read.mesh.tets(), bar.tets());
  ExpectEqual(read.cell_data, file.cell_data);
}

TEST_F(TetMeshIoTest, ArrayNamesWithMarkupAndOtherAlphabetsComeBack) {
  TetMeshFile file = OnlyMesh(SingleTet());
  file.point_data.push_back({"a<b> & \"c\" 'd'", 1, std::vector<double>{1, 2, 3, 4}});
  file.point_data.push_back(
      {"Gewebe \xC3\xA4\xC3\xB6\xC3\xBC", 1, std::vector<double>{1, 2, 3, 4}});
  ASSERT_THAT(WriteTetMesh(Path("named.vtu"), file), IsOk());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile read, ReadTetMesh(Path("named.vtu")));
  ExpectEqual(read.point_data, file.point_data);
}

TEST_F(TetMeshIoTest, NonFiniteNumbersAreReadForValidationToReport) {
  Positions positions = SingleTet().positions();
  positions(2, 1) = std::numeric_limits<double>::infinity();
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, SingleTet().tets()));
  ASSERT_THAT(WriteTetMesh(Path("infinite.vtu"), OnlyMesh(mesh)), IsOk());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile read, ReadTetMesh(Path("infinite.vtu")));
  EXPECT_EQ(read.mesh.positions(), positions);
}

TEST_F(TetMeshIoTest, ReadsAsciiFilesOfOtherPrograms) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile tongue,
                       ReadTetMesh(TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu")));
  EXPECT_EQ(tongue.mesh.num_vertices(), 2238);
  EXPECT_EQ(tongue.mesh.num_tets(), 10980);
  EXPECT_FLOAT_EQ(static_cast<float>(tongue.mesh.positions()(0, 0)), 0.257965F);
  EXPECT_THAT(tongue.point_data, IsEmpty());
}

TEST_F(TetMeshIoTest, EveryFileCarriesTheNotice) {
  ASSERT_THAT(WriteTetMesh(Path("tet.vtu"), OnlyMesh(SingleTet())), IsOk());
  EXPECT_THAT(
      testing::BytesOfFile(Path("tet.vtu")),
      AllOf(HasSubstr("Name=\"notice\""), HasSubstr("<!-- Tissueform research software, not "
                                                    "a medical device")));
}

// As it was written once: arrays in raw bytes at the end, the notice a string among them.
TEST_F(TetMeshIoTest, FilesOfEarlierVersionsAreRead) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile old, ReadTetMesh(TestDataPath("meshes/appended/bar.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile now, ReadTetMesh(TestDataPath("plans/bar/bar.vtu")));
  EXPECT_EQ(old.mesh.positions(), now.mesh.positions());
  EXPECT_EQ(old.mesh.tets(), now.mesh.tets());
  ExpectEqual(old.point_data, now.point_data);
  ExpectEqual(old.cell_data, now.cell_data);
}

TEST_F(TetMeshIoTest, WritingTheSameMeshTwiceGivesTheSameBytes) {
  ASSERT_THAT(WriteTetMesh(Path("a.vtu"), OnlyMesh(SingleTet())), IsOk());
  ASSERT_THAT(WriteTetMesh(Path("b.vtu"), OnlyMesh(SingleTet())), IsOk());
  EXPECT_EQ(testing::BytesOfFile(Path("a.vtu")), testing::BytesOfFile(Path("b.vtu")));
}

TEST_F(TetMeshIoTest, FileOverTheLimitIsRefusedUnread) {
  EXPECT_THAT(ReadTetMesh(TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu"),
                          {.max_file_bytes = 1000}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("at most 1000")));
}

TEST_F(TetMeshIoTest, WritingIntoAMissingFolderIsNotFound) {
  EXPECT_THAT(WriteTetMesh(Path("missing/tet.vtu"), OnlyMesh(SingleTet())),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("there is no folder")));
  EXPECT_THAT(FilesLeft(), IsEmpty());
}

TEST_F(TetMeshIoTest, WritingOverAFolderFails) {
  std::filesystem::create_directory(folder_ / "folder.vtu");
  EXPECT_THAT(WriteTetMesh(Path("folder.vtu"), OnlyMesh(SingleTet())),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("folder.vtu")));
  EXPECT_THAT(FilesLeft(), ::testing::ElementsAre("folder.vtu"));
}

TEST_F(TetMeshIoTest, ArrayOfTheWrongLengthIsRefusedAndTheOldFileStays) {
  std::ofstream(Path("tet.vtu")) << "old";
  TetMeshFile file = OnlyMesh(SingleTet());
  file.point_data.push_back({"short", 1, std::vector<double>{1, 2, 3}});
  EXPECT_THAT(WriteTetMesh(Path("tet.vtu"), file),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("\"short\" holds 3 values")));
  EXPECT_EQ(testing::BytesOfFile(Path("tet.vtu")), "old");
  EXPECT_THAT(FilesLeft(), ::testing::ElementsAre("tet.vtu"));
}

TEST_F(TetMeshIoTest, RefusesArrayNamesThatReadersCannotHandle) {
  for (const std::string& name : {std::string(), std::string("a\nb"), std::string(300, 'x')}) {
    TetMeshFile file = OnlyMesh(SingleTet());
    file.cell_data.push_back({name, 1, std::vector<double>{1}});
    EXPECT_THAT(WriteTetMesh(Path("tet.vtu"), file),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name")));
  }
  EXPECT_THAT(FilesLeft(), IsEmpty());
}

TEST_F(TetMeshIoTest, TwoArraysOfOneNameAreRefused) {
  TetMeshFile file = OnlyMesh(SingleTet());
  file.cell_data.assign(2, {"twice", 1, std::vector<double>{1}});
  EXPECT_THAT(WriteTetMesh(Path("tet.vtu"), file),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("\"twice\"")));
}

TEST_F(TetMeshIoTest, FindAttributeFindsByNameOrGivesNull) {
  const std::vector<Attribute> attributes = {{"a", 1, {}}, {"b", 1, {}}};
  EXPECT_EQ(FindAttribute(attributes, "b"), &attributes[1]);
  EXPECT_EQ(FindAttribute(attributes, "c"), nullptr);
}

}  // namespace
}  // namespace tissueform
