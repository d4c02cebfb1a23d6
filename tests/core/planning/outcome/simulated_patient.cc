// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/planning/outcome/simulated_patient.h"

#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/generation/surface_decimation.h"
#include "core/planning/case_file/predicted_case.h"
#include "core/planning/case_file/skin_follow.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/outcome/model_settings.h"
#include "core/planning/plan_io.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {
namespace {

using Eigen::Vector3d;

std::vector<uint8_t> SkinRegions(const PlanProblem& problem) {
  const std::vector<double> values =
      FindScalars(problem.point_data, "skin_region", "point").value();
  return {values.begin(), values.end()};
}

TriangleMesh Joined(const std::vector<TriangleMesh>& parts) {
  Eigen::Index vertices = 0;
  Eigen::Index triangles = 0;
  for (const TriangleMesh& part : parts) {
    vertices += part.num_vertices();
    triangles += part.num_triangles();
  }
  Positions positions(vertices, 3);
  TriangleIndices indices(triangles, 3);
  Eigen::Index v = 0;
  Eigen::Index t = 0;
  for (const TriangleMesh& part : parts) {
    positions.middleRows(v, part.num_vertices()) = part.positions();
    indices.middleRows(t, part.num_triangles()) =
        part.triangles().array() + static_cast<int32_t>(v);
    v += part.num_vertices();
    t += part.num_triangles();
  }
  return *TriangleMesh::Create(positions, indices);
}

// Other triangles at other places.
TriangleMesh Rescanned(const TriangleMesh& mesh, const Simulation& simulation,
                       std::mt19937* random) {
  const absl::StatusOr<TriangleMesh> coarser = DecimateSurface(mesh, mesh.num_triangles() * 6 / 10);
  const TriangleMesh& used = coarser.ok() ? *coarser : mesh;
  std::normal_distribution<double> noise(0, simulation.noise_mm);
  Positions positions = used.positions();
  if (simulation.noise_mm > 0) {
    for (double& value : positions.reshaped()) value += noise(*random);
  }
  return *TriangleMesh::Create(Moved(positions, simulation.position), used.triangles());
}

Positions Operated(const PlanProblem& problem, const std::vector<HandlePose>& poses,
                   const Simulation& simulation) {
  Eigen::VectorXd stiffness = WithContrast(problem.stiffness, simulation.contrast);
  const double middle = problem.mesh->positions().col(2).mean();
  for (Eigen::Index t = 0; t < stiffness.size(); ++t) {
    if (problem.mesh->positions()(problem.mesh->tets()(t, 0), 2) > middle) {
      stiffness[t] *= simulation.stiffer;
    }
  }
  DeformerOptions options = problem.deformer;
  options.model = simulation.model;
  const auto deformer = CreateDeformer(*problem.mesh, stiffness, problem.constraints, options);
  return (*deformer)->Deform(poses)->positions;
}

}  // namespace

PreOperativeHead BundledHead(const std::string& plan) {
  return HeadOfPlan(TestDataPath("plans/" + plan));
}

PreOperativeHead HeadOfPlan(const std::string& folder) {
  PlanProblem problem = *ResolvePlan(*ReadPlan(absl::StrCat(folder, "/plan.json")));
  const ViewerFile viewer = *ReadViewer(absl::StrCat(folder, "/", kViewerFile));
  CaseFile contents;
  contents.mesh.vertex_count = problem.mesh->num_vertices();
  contents.mesh.payload.assign(
      reinterpret_cast<const char*>(problem.mesh->positions().data()),
      static_cast<size_t>(problem.mesh->positions().size()) * sizeof(double));
  contents.surfaces = viewer.surfaces;
  CaseSurface& skin = contents.surfaces.front();
  skin.follows = FollowSkin(skin.positions, skin.triangles, *problem.mesh, problem.constraints);
  skin.regions = RegionsOfFollowers(*skin.follows, SkinRegions(problem));
  contents.landmarks = viewer.landmarks;
  contents.head_frame = viewer.head_frame;
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    const HandleRegion& region = problem.constraints.handles()[h];
    contents.handles.push_back(
        {.name = region.name,
         .pivot_mm = problem.mesh->positions()(region.vertices, Eigen::all).colwise().mean(),
         .pose = problem.poses[h]});
  }
  return {.problem = std::move(problem), .contents = std::move(contents)};
}

RigidMove RandomMove(std::mt19937* random, double most_deg, double most_mm) {
  std::uniform_real_distribution<double> share(-1, 1);
  const auto vector = [&] { return Vector3d(share(*random), share(*random), share(*random)); };
  const double angle = share(*random) * most_deg * std::numbers::pi / 180;
  const Vector3d axis = vector().normalized();
  return {Eigen::AngleAxisd(angle, axis).toRotationMatrix(), most_mm * vector()};
}

std::vector<HandlePose> MissedPlan(const PreOperativeHead& pre, std::mt19937* random) {
  std::vector<HandlePose> poses;
  for (const CaseHandle& handle : pre.contents.handles) {
    const HandlePose error = PoseOf(RandomMove(random, 1, 1), {0, 0, 0});
    HandlePose pose = PoseOf(MoveOf(handle.pose), handle.pivot_mm);
    pose.translation_mm += error.translation_mm;
    pose.rotation_vector += error.rotation_vector;
    poses.push_back(pose);
  }
  return poses;
}

PostOperativeHead OperatedHead(const PreOperativeHead& pre, const std::vector<HandlePose>& poses,
                               const Simulation& simulation, std::mt19937* random) {
  std::map<std::string, HandlePose> by_name;
  for (size_t h = 0; h < poses.size(); ++h) by_name[pre.contents.handles[h].name] = poses[h];
  const PredictedCase after =
      *PredictCase(pre.contents, Operated(pre.problem, poses, simulation), by_name);
  std::vector<TriangleMesh> bones;
  for (size_t s = 0; s < after.surfaces.size(); ++s) {
    if (pre.contents.surfaces[s].kind == SurfaceKind::kSkin) continue;
    bones.push_back(*TriangleMesh::Create(after.surfaces[s].cast<double>(),
                                          pre.contents.surfaces[s].triangles));
  }
  const TriangleMesh skin = *TriangleMesh::Create(after.surfaces.front().cast<double>(),
                                                  pre.contents.surfaces.front().triangles);
  return {.skin = Rescanned(skin, simulation, random),
          .bone = Rescanned(Joined(bones), simulation, random)};
}

void ExpectMovements(const Outcome& outcome, const std::vector<HandlePose>& real) {
  ASSERT_EQ(outcome.segments.size(), real.size());
  for (size_t s = 0; s < real.size(); ++s) {
    const RigidMove wrong = Composed(MoveOf(outcome.segments[s].real), Inverse(MoveOf(real[s])));
    const Vector3d pivot = real[s].pivot_mm;
    EXPECT_LT((wrong(pivot) - pivot).norm(), 0.2) << outcome.segments[s].handle;
    EXPECT_LT(TurnDegrees(wrong), 0.3) << outcome.segments[s].handle;
  }
}

void ExpectErrorsByRegion(const Outcome& outcome, const TriangleMesh& true_skin) {
  constexpr double kTrueErrorMm = 0.1;
  const ComparedPrediction& predicted = outcome.predictions.front();
  EXPECT_EQ(predicted.movement, "real");
  const std::vector<RegionComparison> expected =
      CompareFaces(predicted.face, SignedSurface(true_skin));
  ASSERT_EQ(expected.size(), predicted.regions.size());
  for (size_t r = 0; r < expected.size(); ++r) {
    const DistanceStatistics& found = predicted.regions[r].predicted_to_real;
    const DistanceStatistics& given = expected[r].predicted_to_real;
    EXPECT_NEAR(found.mean_mm, given.mean_mm, kTrueErrorMm) << expected[r].region;
    EXPECT_NEAR(found.mean_absolute_mm, given.mean_absolute_mm, kTrueErrorMm) << expected[r].region;
  }
}

}  // namespace tissueform::testing
