// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_mesh.h"

#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/triangle_mesh.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

TEST(TetMeshTest, IndexBeyondTheVerticesIsRefusedAndNamed) {
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 0, 1, 2, 4;
  EXPECT_THAT(TetMesh::Create(Positions::Random(4, 3), tets),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("tet 1"), HasSubstr("vertex 4"))));
}

TEST(TetMeshTest, NegativeIndexIsRefused) {
  TetIndices tets(1, 4);
  tets << 0, 1, -1, 3;
  EXPECT_THAT(TetMesh::Create(Positions::Random(4, 3), tets),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("vertex -1")));
}

TEST(TetMeshTest, EmptyMeshIsRefused) {
  EXPECT_THAT(TetMesh::Create(Positions(0, 3), TetIndices(0, 4)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0 vertices")));
}

TEST(TetMeshTest, DiagonalOfABarIsThatOfItsBox) {
  EXPECT_DOUBLE_EQ(testing::Bar({1, 2, 3}, 2.0).BoundingBoxDiagonal(), 2.0 * std::sqrt(14.0));
}

TEST(TriangleMeshTest, IndexBeyondTheVerticesIsRefused) {
  TriangleIndices triangles(1, 3);
  triangles << 0, 1, 3;
  EXPECT_THAT(TriangleMesh::Create(Positions::Random(3, 3), triangles),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("triangle 0")));
  triangles(0, 2) = 2;
  EXPECT_THAT(TriangleMesh::Create(Positions::Random(3, 3), triangles), IsOk());
}

}  // namespace
}  // namespace tissueform
