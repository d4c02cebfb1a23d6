// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// Files that meshio and VTK wrote, with points, lines and faces beside two tets.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using tissueform::testing::TestDataPath;

class LeftOutCellsTest : public ::testing::TestWithParam<const char*> {
 protected:
  const absl::StatusOr<TetMeshFile> file_ =
      ReadTetMesh(TestDataPath(std::string("meshes/mixed_cells/") + GetParam()));
};

TEST_P(LeftOutCellsTest, TetsAndAllVerticesKeepTheirOrder) {
  ASSERT_TRUE(file_.ok()) << file_.status();
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 1, 2, 3, 4;
  EXPECT_EQ(file_->mesh.tets(), tets);
  // Also vertices 5 to 7, of faces only: numbers in a plan count those of the file.
  EXPECT_EQ(file_->mesh.num_vertices(), 8);
  EXPECT_EQ(file_->mesh.positions().row(4), Eigen::RowVector3d(2, 2.5, 3.5));
  EXPECT_THAT(ToDoubles(*FindAttribute(file_->point_data, "number")),
              ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
}

TEST_P(LeftOutCellsTest, CellsAreCountedAndTheirValuesGoWithThem) {
  ASSERT_TRUE(file_.ok()) << file_.status();
  EXPECT_EQ(file_->left_out_cells, 5);
  EXPECT_THAT(ToDoubles(*FindAttribute(file_->cell_data, "part")), ElementsAre(1, 5));
  EXPECT_THAT(ToDoubles(*FindAttribute(file_->cell_data, "triple")),
              ElementsAre(1, 0.5, -1, 5, 2.5, -5));
}

INSTANTIATE_TEST_SUITE_P(Files, LeftOutCellsTest,
                         ::testing::Values("meshio.vtu", "meshio.vtk", "vtk.vtu", "vtk_ascii.vtk",
                                           "vtk_binary.vtk"),
                         [](const auto& test) {
                           std::string name = test.param;
                           name[name.find('.')] = '_';
                           return name;
                         });

}  // namespace
}  // namespace tissueform
