// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The surface counterpart of the gradient-field deformer (Liao et al. 2009, Eq. 13).

#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::LargestDistance;
using testing::StatusIs;

struct SurfaceBar {
  TriangleMesh mesh;
  ConstraintSet ends;
};

// Boundary of a bar with its vertices renumbered.
SurfaceBar MakeSurfaceBar() {
  const TetMesh bar = testing::Bar({3, 3, 12}, 1.0, 0.1);
  const TriangleIndices facets = BoundaryFacets(bar);
  const std::vector<int32_t> vertices = BoundaryVertices(bar);
  std::vector<int32_t> number(bar.num_vertices(), -1);
  for (size_t k = 0; k < vertices.size(); ++k) {
    number[vertices[k]] = static_cast<int32_t>(k);
  }
  const TriangleIndices triangles = facets.unaryExpr([&](int32_t v) { return number[v]; });
  auto mesh = TriangleMesh::Create(bar.positions()(vertices, Eigen::all), triangles);
  std::vector<int32_t> low;
  std::vector<int32_t> high;
  for (int32_t v = 0; v < mesh->num_vertices(); ++v) {
    const double z = mesh->positions()(v, 2);
    if (z < 0.5) {
      low.push_back(v);
    } else if (z > 11.5) {
      high.push_back(v);
    }
  }
  auto ends = ConstraintSet::Create(mesh->num_vertices(), low, {{"top", high}});
  return {*std::move(mesh), *std::move(ends)};
}

class SurfaceDeformerTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<Deformer>> Create(const GradientFieldOptions& options = {}) const {
    return CreateSurfaceGradientFieldDeformer(bar_.mesh, stiffness_, bar_.ends, options);
  }

  const SurfaceBar bar_ = MakeSurfaceBar();
  const Eigen::VectorXd stiffness_ =
      Eigen::VectorXd::LinSpaced(bar_.mesh.num_triangles(), 1000, 9000);
};

TEST_F(SurfaceDeformerTest, IdentityPoseGivesTheRestShapeExactly) {
  ASSERT_OK_AND_ASSIGN(const auto deformer, Create());
  const std::vector<HandlePose> poses(1);
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  EXPECT_EQ(result.positions, bar_.mesh.positions());
}

TEST_F(SurfaceDeformerTest, RigidMotionOfEverythingMovesTheAnswer) {
  const Eigen::Matrix3d R = RotationMatrix({1.1, -0.4, 0.6});
  const auto move = [&](const Positions& x) -> Positions { return x * R.transpose(); };
  ASSERT_OK_AND_ASSIGN(const TriangleMesh moved_mesh,
                       TriangleMesh::Create(move(bar_.mesh.positions()), bar_.mesh.triangles()));
  GradientFieldOptions options;
  for (const RotationMode mode : {RotationMode::kPropagated, RotationMode::kEstimated}) {
    options.rotation = mode;
    ASSERT_OK_AND_ASSIGN(const auto deformer, Create(options));
    ASSERT_OK_AND_ASSIGN(
        const auto moved_deformer,
        CreateSurfaceGradientFieldDeformer(moved_mesh, stiffness_, bar_.ends, options));
    std::vector<HandlePose> poses(1);
    poses[0].translation_mm = {1, 2, 0};
    poses[0].rotation_vector = {0.2, 0.1, 0.7};
    std::vector<HandlePose> moved_poses = poses;
    moved_poses[0].translation_mm = R * poses[0].translation_mm;
    moved_poses[0].rotation_vector = R * poses[0].rotation_vector;
    ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
    ASSERT_OK_AND_ASSIGN(const Deformation moved, moved_deformer->Deform(moved_poses));
    EXPECT_LT(LargestDistance(moved.positions, move(result.positions)), 1e-9);
  }
}

// Without a fixed region one rigid pose on both ends must carry the whole surface along.
TEST_F(SurfaceDeformerTest, OneRigidPoseOnEverythingIsThatRigidMotion) {
  ASSERT_OK_AND_ASSIGN(const ConstraintSet both,
                       ConstraintSet::Create(
                           bar_.mesh.num_vertices(), {},
                           {{"low", bar_.ends.fixed()}, {"top", bar_.ends.handles()[0].vertices}}));
  ASSERT_OK_AND_ASSIGN(const auto deformer,
                       CreateSurfaceGradientFieldDeformer(bar_.mesh, stiffness_, both, {}));
  HandlePose pose;
  pose.rotation_vector = {0.5, 1.0, -0.3};
  pose.translation_mm = {4, 5, 6};
  const std::vector<HandlePose> poses = {pose, pose};
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  for (Eigen::Index v = 0; v < bar_.mesh.num_vertices(); ++v) {
    EXPECT_LT((result.positions.row(v).transpose() -
               ApplyPose(pose, bar_.mesh.positions().row(v).transpose()))
                  .norm(),
              1e-10);
  }
}

TEST_F(SurfaceDeformerTest, EstimatedRotationsBendTheBar) {
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.max_iterations = 200;
  ASSERT_OK_AND_ASSIGN(const auto estimated, Create(options));
  options.rotation = RotationMode::kNone;
  ASSERT_OK_AND_ASSIGN(const auto plain, Create(options));
  std::vector<HandlePose> poses(1);
  poses[0].translation_mm = {0, 4, 0};
  ASSERT_OK_AND_ASSIGN(const Deformation bent, estimated->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation sheared, plain->Deform(poses));
  EXPECT_TRUE(bent.summary.converged);
  EXPECT_GT(LargestDistance(bent.positions, sheared.positions), 0.1);
}

TEST_F(SurfaceDeformerTest, TriangleWithoutAreaIsRefused) {
  Positions positions(3, 3);
  positions << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  TriangleIndices triangles(1, 3);
  triangles << 0, 1, 2;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh flat, TriangleMesh::Create(positions, triangles));
  ASSERT_OK_AND_ASSIGN(const ConstraintSet ends, ConstraintSet::Create(3, {0}, {{"top", {1}}}));
  EXPECT_THAT(CreateSurfaceGradientFieldDeformer(flat, Eigen::VectorXd::Ones(1), ends, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("triangle 0 has no area")));
}

}  // namespace
}  // namespace tissueform
