// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "core/mechanics/deformation/mesh_preparation.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// Numbers in [-1, 1), the same in every run.
class RandomNumbers {
 public:
  explicit RandomNumbers(uint32_t seed) : generator_(seed) {}
  double Next() { return 2.0 * generator_() / 4294967296.0 - 1.0; }
  Eigen::Vector3d Vector() { return {Next(), Next(), Next()}; }

 private:
  std::mt19937 generator_;
};

// Of two positions of one vertex.
template <typename Given, typename Expected>
double LargestDistance(const Given& given, const Expected& expected) {
  return (given.template cast<double>() - expected).rowwise().norm().maxCoeff();
}

// Stiffness between 3 and 53 kPa.
inline Eigen::VectorXd MixedStiffness(Eigen::Index num_tets) {
  RandomNumbers random(3);
  Eigen::VectorXd stiffness(num_tets);
  for (double& value : stiffness) {
    value = 28000.0 + 25000.0 * random.Next();
  }
  return stiffness;
}

// The lowest part of a mesh along z fixed, the highest part cut into handles along y.
inline ConstraintSet StackedHandles(const TetMesh& mesh, int num_handles) {
  const Eigen::RowVector3d low = mesh.positions().colwise().minCoeff();
  const Eigen::RowVector3d size = mesh.positions().colwise().maxCoeff() - low;
  const auto part = [=](const Eigen::Vector3d& v, int axis) {
    return (v[axis] - low[axis]) / size[axis];
  };
  std::vector<HandleRegion> handles;
  for (int h = 0; h < num_handles; ++h) {
    // Gaps keep tets from being torn.
    const double margin = num_handles > 1 ? 0.15 : -1;
    handles.push_back(
        {"handle " + std::to_string(h), SelectVertices(mesh, [&](const Eigen::Vector3d& v) {
           const double y = part(v, 1) * num_handles - h;
           return part(v, 2) >= 0.8 && y >= margin && y <= 1 - margin;
         })});
  }
  return *ConstraintSet::Create(
      mesh, SelectVertices(mesh, [&](const Eigen::Vector3d& v) { return part(v, 2) <= 0.15; }),
      handles);
}

inline std::shared_ptr<MeshPreparation> PrepareMesh(const TetMesh& mesh, int num_handles,
                                                    PreparationOptions options = {}) {
  return *MeshPreparation::Create(mesh, MixedStiffness(mesh.num_tets()),
                                  StackedHandles(mesh, num_handles), std::move(options));
}

// Every handle turned by `angle` about its own axis, scaled by 1 + `scale_change` or 1 -
// `scale_change`, and moved by some of the mesh's size.
inline std::vector<HandlePose> RandomPoses(size_t num_handles, double angle, double scale_change,
                                           double size, RandomNumbers* random) {
  std::vector<HandlePose> poses(num_handles);
  for (HandlePose& pose : poses) {
    pose.rotation_vector = angle * random->Vector().normalized();
    pose.pivot_mm = 0.5 * size * random->Vector();
    pose.translation_mm = 0.1 * size * random->Vector();
    pose.scale = 1 + (random->Next() < 0 ? -scale_change : scale_change);
  }
  return poses;
}

// So many poses of one handle: turned about a point and moved, up to so much along each axis.
inline std::vector<HandlePose> PosesAbout(const Eigen::Vector3d& pivot_mm, double most_rad,
                                          double most_mm, size_t count, uint32_t seed) {
  RandomNumbers random(seed);
  std::vector<HandlePose> poses(count);
  for (HandlePose& pose : poses) {
    pose.rotation_vector = most_rad * random.Vector();
    pose.pivot_mm = pivot_mm;
    pose.translation_mm = most_mm * random.Vector();
  }
  return poses;
}

inline std::vector<int32_t> AllVertices(const TetMesh& mesh) {
  return SelectVertices(mesh, [](const Eigen::Vector3d&) { return true; });
}

}  // namespace tissueform::testing
