// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/closed_skin.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"
#include <Eigen/Eigenvalues>

#include "core/mesh/border_loops.h"

namespace tissueform {
namespace {

// An opening that is narrower is a defect of the surface, not the end of what was scanned.
constexpr double kCutOpeningMm = 20;
// Of its width: a plane cut of a neck is within 2 to 5 %.
constexpr double kLargestUnevenness = 0.1;
// A loop runs along a face of the box when this share of its vertices is so near to it.
constexpr double kOnFaceMm = 2;
constexpr double kOpenFaceShare = 0.1;

// Largest distance of a loop's vertices from the plane that fits them best, over its width.
double Unevenness(const TriangleMesh& mesh, const std::vector<int32_t>& loop) {
  Eigen::Matrix3Xd places(3, static_cast<Eigen::Index>(loop.size()));
  for (size_t i = 0; i < loop.size(); ++i) {
    places.col(static_cast<Eigen::Index>(i)) = mesh.positions().row(loop[i]).transpose();
  }
  const Eigen::Vector3d center = places.rowwise().mean();
  places.colwise() -= center;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(places * places.transpose());
  const Eigen::Vector3d normal = axes.eigenvectors().col(0);
  return (normal.transpose() * places).cwiseAbs().maxCoeff() / LoopWidthMm(mesh, loop);
}

// Opens the faces of the box along which a good part of the loop runs.
void OpenFacesAlong(const TriangleMesh& mesh, const std::vector<int32_t>& loop, OpenBox* open) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto column = static_cast<Eigen::Index>(axis);
    const auto share_near = [&](double face) {
      const auto count = std::count_if(loop.begin(), loop.end(), [&](int32_t v) {
        return std::abs(mesh.positions()(v, column) - face) < kOnFaceMm;
      });
      return static_cast<double>(count) / static_cast<double>(loop.size());
    };
    open->low.at(axis) |= share_near(open->box.min()[column]) > kOpenFaceShare;
    open->high.at(axis) |= share_near(open->box.max()[column]) > kOpenFaceShare;
  }
}

// The open faces as triangles.
TriangleMesh FacesOf(const OpenBox& open) {
  std::vector<Eigen::Vector3d> corners;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool high : {false, true}) {
      if (!(high ? open.high : open.low).at(static_cast<size_t>(axis))) continue;
      for (const auto& [u, v] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}}) {
        Eigen::Vector3d corner = high ? open.box.max() : open.box.min();
        for (const auto& [other, far] : {std::pair((axis + 1) % 3, u), {(axis + 2) % 3, v}}) {
          corner[other] = far == 0 ? open.box.min()[other] : open.box.max()[other];
        }
        corners.push_back(corner);
      }
    }
  }
  Positions positions(static_cast<Eigen::Index>(corners.size()), 3);
  TriangleIndices triangles(positions.rows() / 3, 3);
  for (size_t i = 0; i < corners.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    positions.row(row) = corners[i].transpose();
    triangles(row / 3, row % 3) = static_cast<int32_t>(i);
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

TriangleMesh Joined(const TriangleMesh& a, const TriangleMesh& b) {
  Positions positions(a.num_vertices() + b.num_vertices(), 3);
  positions << a.positions(), b.positions();
  TriangleIndices triangles(a.num_triangles() + b.num_triangles(), 3);
  triangles << a.triangles(),
      (b.triangles().array() + static_cast<int32_t>(a.num_vertices())).matrix();
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

}  // namespace

Eigen::AlignedBox3d BoxOf(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const auto& t : mesh.triangles().rowwise()) {
    for (const int32_t v : t) box.extend(mesh.positions().row(v).transpose());
  }
  return box;
}

TriangleMesh ClosedSkin::WithCaps() const { return caps ? Joined(skin, *caps) : skin; }

// A wide opening that is even is closed through its center. An uneven one, as where a box was cut
// out of a head, is left to the faces of the box.
ClosedSkin CloseSkin(const TriangleMesh& skin, std::vector<std::string>* notes) {
  std::vector<std::vector<int32_t>> wide;
  std::vector<std::vector<int32_t>> closed_loops;
  OpenBox open{.box = BoxOf(skin)};
  size_t num_small = 0;
  for (std::vector<int32_t>& loop : BorderLoops(skin)) {
    if (LoopWidthMm(skin, loop) <= kCutOpeningMm) {
      ++num_small;
      closed_loops.push_back(std::move(loop));
      continue;
    }
    OpenBox by_loop{.box = open.box};
    if (Unevenness(skin, loop) > kLargestUnevenness) OpenFacesAlong(skin, loop, &by_loop);
    if (by_loop.any()) {
      OpenFacesAlong(skin, loop, &open);
    } else {
      wide.push_back(loop);
      closed_loops.push_back(std::move(loop));
    }
  }
  ClosedSkin closed{.skin = WithOpeningsClosed(skin, closed_loops), .open = open, .caps = {}};
  if (!wide.empty()) {
    const TriangleMesh with_caps = WithOpeningsClosed(skin, wide);
    closed.caps = *TriangleMesh::Create(
        with_caps.positions(),
        with_caps.triangles().bottomRows(with_caps.num_triangles() - skin.num_triangles()));
  }
  if (open.any()) {
    const TriangleMesh faces = FacesOf(open);
    closed.caps = closed.caps ? Joined(*closed.caps, faces) : faces;
  }
  if (num_small > 0) {
    notes->push_back(
        absl::StrFormat("Small openings of the skin that were closed: %d.", num_small));
  }
  if (closed.caps) {
    notes->push_back(
        "The skin is open; the head is taken as cut off there, and the cut is not skin.");
  }
  return closed;
}

}  // namespace tissueform
