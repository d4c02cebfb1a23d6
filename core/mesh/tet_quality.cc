// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// Dihedral angle at the edge from p to q between the facets that end in r and in s. From atan2,
// which unlike acos keeps its digits near 0 and 180 degrees.
double DihedralAngleDeg(const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                        const Eigen::Vector3d& r, const Eigen::Vector3d& s) {
  const Eigen::Vector3d edge = q - p;
  const Eigen::Vector3d normal_r = edge.cross(r - p);
  const Eigen::Vector3d normal_s = edge.cross(s - p);
  if (normal_r.squaredNorm() == 0 || normal_s.squaredNorm() == 0) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double radians = std::atan2(normal_r.cross(normal_s).norm(), normal_r.dot(normal_s));
  return radians * 180.0 / std::numbers::pi;
}

}  // namespace

Eigen::VectorXd TetVolumes(const Positions& positions, const TetIndices& tets) {
  Eigen::VectorXd volumes(tets.rows());
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    const Eigen::RowVector3d origin = positions.row(tets(t, 0));
    const Eigen::RowVector3d a = positions.row(tets(t, 1)) - origin;
    const Eigen::RowVector3d b = positions.row(tets(t, 2)) - origin;
    const Eigen::RowVector3d c = positions.row(tets(t, 3)) - origin;
    volumes[t] = a.dot(b.cross(c)) / 6.0;
  }
  return volumes;
}

Eigen::Index RepairOrientation(const Positions& positions, TetIndices* tets) {
  // Written so that a volume of zero or NaN, too, leaves the mesh to ValidateTetMesh.
  if (tets->rows() == 0 || !(TetVolumes(positions, *tets).array() < 0).all()) return 0;
  tets->col(2).swap(tets->col(3));
  return tets->rows();
}

Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor> DihedralAnglesDeg(
    const Positions& positions, const TetIndices& tets) {
  Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor> angles(tets.rows(), 6);
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    for (int e = 0; e < 6; ++e) {
      const auto [p, q] = kTetEdges[e];
      const auto [r, s] = kTetEdges[5 - e];
      angles(t, e) = DihedralAngleDeg(positions.row(tets(t, p)), positions.row(tets(t, q)),
                                      positions.row(tets(t, r)), positions.row(tets(t, s)));
    }
  }
  return angles;
}

TetQualitySummary SummarizeTetQuality(const TetMesh& mesh) {
  const Eigen::VectorXd volumes = TetVolumes(mesh.positions(), mesh.tets());
  const auto angles = DihedralAnglesDeg(mesh.positions(), mesh.tets());
  TetQualitySummary summary;
  summary.total_volume_mm3 = volumes.sum();
  summary.min_volume_mm3 = volumes.minCoeff();
  summary.max_volume_mm3 = volumes.maxCoeff();
  summary.min_dihedral_deg = 180;
  for (Eigen::Index t = 0; t < angles.rows(); ++t) {
    // A tet with a facet of no area has no angles; it counts as flat.
    const double smallest = angles.row(t).hasNaN() ? 0.0 : angles.row(t).minCoeff();
    const double largest = angles.row(t).hasNaN() ? 180.0 : angles.row(t).maxCoeff();
    summary.min_dihedral_deg = std::min(summary.min_dihedral_deg, smallest);
    summary.max_dihedral_deg = std::max(summary.max_dihedral_deg, largest);
    summary.tets_below_5_deg += smallest < 5.0 ? 1 : 0;
    summary.tets_below_10_deg += smallest < 10.0 ? 1 : 0;
  }
  return summary;
}

}  // namespace tissueform
