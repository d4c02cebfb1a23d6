// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/scene_renderer.h"

#include <random>
#include <vtkCamera.h>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Vector3d;

// A box of points with its widest part far from the middle, as ears are.
Positions Points(const Vector3d& size, std::mt19937* random) {
  std::uniform_real_distribution<double> part(-0.3, 1);
  Positions points(200, 3);
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    for (int axis = 0; axis < 3; ++axis) points(p, axis) = 37 + size[axis] * part(*random);
  }
  return points;
}

// Where a camera sees a place: from -1 to 1 across a panel, and up.
Eigen::Vector2d Seen(vtkCamera* camera, double aspect, const Vector3d& place) {
  const Vector3d focal(camera->GetFocalPoint());
  const Vector3d towards = (Vector3d(camera->GetPosition()) - focal).normalized();
  const Vector3d up = Vector3d(camera->GetViewUp()).normalized();
  const Vector3d right = up.cross(towards);
  const double half = camera->GetParallelScale();
  return {right.dot(place - focal) / (half * aspect), up.dot(place - focal) / half};
}

// A head with ears is wider than one without, and its ears must not run over the panel's edge.
TEST(SceneRendererTest, EverythingThatIsShownLiesInItsPanel) {
  std::mt19937 random(3);
  for (const Vector3d& size :
       {Vector3d(200, 100, 80), Vector3d(40, 200, 30), Vector3d(30, 20, 300)}) {
    for (const Vector3d& from : {Vector3d(0, -1, 0), Vector3d(1, 0, 0), Vector3d(0.75, -1, 0.1)}) {
      for (const bool legend : {false, true}) {
        Scene scene;
        scene.view.from = from;
        scene.surfaces.resize(1);
        scene.surfaces[0].positions = Points(size, &random);
        scene.room_for = Points(1.1 * size, &random);
        scene.room_for_legend = legend;
        for (const double aspect : {0.6, 600.0 / 700.0, 2.5}) {
          const auto renderer = RenderScene(scene, HalfHeightToHold(scene, aspect));
          for (const Positions& positions : {scene.surfaces[0].positions, scene.room_for}) {
            for (const auto& row : positions.rowwise()) {
              const Eigen::Vector2d seen =
                  Seen(renderer->GetActiveCamera(), aspect, row.transpose());
              ASSERT_LT(seen.cwiseAbs().maxCoeff(), 0.97) << seen.transpose();
            }
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
