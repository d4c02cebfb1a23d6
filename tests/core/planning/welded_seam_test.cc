// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/welded_seam.h"

#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::PartedBlock;
using ::tissueform::testing::StatusIs;

TetMeshFile FileOf(TetMesh mesh) {
  std::vector<int16_t> numbers;
  std::vector<float> threes;
  for (int16_t v = 0; v < mesh.num_vertices(); ++v) {
    numbers.push_back(v);
    threes.insert(threes.end(), {1.0F * v, 2.0F * v, 3.0F * v});
  }
  const std::vector<double> pa(static_cast<size_t>(mesh.num_tets()), 2000);
  return {.mesh = std::move(mesh),
          .point_data = {{"number", 1, numbers}, {"threes", 3, threes}},
          .cell_data = {{"pa", 1, pa}}};
}

TEST(WeldedSeamTest, TheMeshIsThatBeforeTheCutToTheLastBit) {
  const PartedBlock block;
  ASSERT_GT(block.mesh.num_vertices(), PartedBlock::Whole().num_vertices());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile welded, WeldSeam(FileOf(block.mesh), block.rows));
  const TetMeshFile whole = FileOf(PartedBlock::Whole());
  EXPECT_EQ(welded.mesh.positions(), whole.mesh.positions());
  EXPECT_EQ(welded.mesh.tets(), whole.mesh.tets());
  for (size_t a = 0; a < whole.point_data.size(); ++a) {
    EXPECT_EQ(welded.point_data[a].values, whole.point_data[a].values);
  }
  EXPECT_EQ(welded.cell_data[0].values, whole.cell_data[0].values);
}

TEST(WeldedSeamTest, MeshWithoutDoubledVerticesIsUnchanged) {
  const TetMesh whole = PartedBlock::Whole();
  std::vector<ContactRow> rows = PartedBlock::Slides();
  rows.push_back({.vertex = 20, .other = 23, .normal = Eigen::Vector3d::UnitY(), .gap_mm = 1});
  ASSERT_OK_AND_ASSIGN(const TetMeshFile same, WeldSeam(FileOf(whole), rows));
  EXPECT_EQ(same.mesh.positions(), whole.positions());
  EXPECT_EQ(same.mesh.tets(), whole.tets());
}

TEST(WeldedSeamTest, DoublesOfADoubleGoToTheFirstVertex) {
  PartedBlock block;
  Positions positions = block.mesh.positions();
  const auto last = static_cast<int32_t>(positions.rows());
  positions.conservativeResize(last + 1, 3);
  positions.row(last) = positions.row(last - 1);
  TetIndices tets = block.mesh.tets();
  for (int32_t& corner : tets.bottomRows(1).reshaped()) {
    if (corner == last - 1) corner = last;
  }
  block.rows.push_back({.vertex = last, .other = last - 1, .normal = Eigen::Vector3d::UnitZ()});
  ASSERT_OK_AND_ASSIGN(TetMesh mesh, TetMesh::Create(positions, tets));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile welded, WeldSeam(FileOf(std::move(mesh)), block.rows));
  EXPECT_EQ(welded.mesh.tets(), PartedBlock::Whole().tets());
}

TEST(WeldedSeamTest, DoublesThatAreNotLastAreRefused) {
  const PartedBlock block;
  Positions positions = block.mesh.positions();
  const Eigen::Index last = positions.rows();
  positions.conservativeResize(last + 1, 3);
  positions.row(last) << 9, 9, 9;
  ASSERT_OK_AND_ASSIGN(TetMesh mesh, TetMesh::Create(positions, block.mesh.tets()));
  EXPECT_THAT(WeldSeam(FileOf(std::move(mesh)), block.rows),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("vertex 45 doubles vertex 21 and is not among the last")));
}

TEST(WeldedSeamTest, VerticesThatAreMissingAndTetsThatWouldVanishAreRefused) {
  const PartedBlock block;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (const auto& [vertex, other] : {std::pair{3, 900}, {900, 3}, {3, -2}}) {
    EXPECT_THAT(WeldSeam(FileOf(block.mesh), {{.vertex = vertex, .other = other, .normal = up}}),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contact row 0 names")));
  }
  TetIndices tets = block.mesh.tets();
  tets.row(0) << 21, 45, 0, 1;
  ASSERT_OK_AND_ASSIGN(TetMesh mesh, TetMesh::Create(block.mesh.positions(), tets));
  EXPECT_THAT(WeldSeam(FileOf(std::move(mesh)), block.rows),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("tet 0 has vertices 21 and")));
}

}  // namespace
}  // namespace tissueform
