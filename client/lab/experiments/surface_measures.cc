// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/surface_measures.h"

#include <algorithm>
#include <numeric>
#include <vtkTriangle.h>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

Eigen::Vector3d Corner(const Positions& positions, const TriangleIndices& triangles, Eigen::Index f,
                       int corner) {
  return positions.row(triangles(f, corner));
}

// Where the edge from `below` to `above` meets the plane at `height`.
Eigen::Vector2d Crossing(const Eigen::Vector3d& below, const Eigen::Vector3d& above,
                         double height) {
  const double along = (height - below.z()) / (above.z() - below.z());
  return below.head<2>() + along * (above.head<2>() - below.head<2>());
}

// Twice the area that the triangle's cut adds to the section, by Green's theorem. A vertex in the
// plane counts as above, so every cut has exactly two ends.
double TwiceCutArea(const Eigen::Vector3d (&corners)[3], double height) {
  Eigen::Vector2d rising = Eigen::Vector2d::Zero();
  Eigen::Vector2d falling = Eigen::Vector2d::Zero();
  bool cut = false;
  for (int corner = 0; corner < 3; ++corner) {
    const Eigen::Vector3d& from = corners[corner];
    const Eigen::Vector3d& to = corners[(corner + 1) % 3];
    if ((from.z() >= height) == (to.z() >= height)) continue;
    cut = true;
    if (to.z() >= height) {
      rising = Crossing(from, to, height);
    } else {
      falling = Crossing(to, from, height);
    }
  }
  // Seen from above, the outline runs from the falling to the rising edge of an outward triangle.
  return cut ? falling.x() * rising.y() - falling.y() * rising.x() : 0.0;
}

// Neighbours always touch, and are no intersection.
bool ShareVertex(const TriangleIndices& triangles, Eigen::Index a, Eigen::Index b) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (triangles(a, i) == triangles(b, j)) return true;
    }
  }
  return false;
}

using Box = Eigen::AlignedBox3d;

std::vector<Box> BoxesOf(const Positions& positions, const TriangleIndices& triangles) {
  std::vector<Box> boxes(static_cast<size_t>(triangles.rows()));
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      boxes[static_cast<size_t>(f)].extend(Corner(positions, triangles, f, corner));
    }
  }
  return boxes;
}

bool TrianglesIntersect(const Positions& positions, const TriangleIndices& triangles,
                        Eigen::Index a, Eigen::Index b) {
  const auto corner = [&](Eigen::Index f, int c) { return positions.row(triangles(f, c)).data(); };
  return vtkTriangle::TrianglesIntersect(corner(a, 0), corner(a, 1), corner(a, 2), corner(b, 0),
                                         corner(b, 1), corner(b, 2)) != 0;
}

}  // namespace

double EnclosedVolume(const Positions& positions, const TriangleIndices& triangles) {
  double six_volumes = 0;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    six_volumes +=
        Corner(positions, triangles, f, 0)
            .dot(Corner(positions, triangles, f, 1).cross(Corner(positions, triangles, f, 2)));
  }
  return six_volumes / 6;
}

std::vector<double> SectionAreas(const Positions& positions, const TriangleIndices& triangles,
                                 const std::vector<double>& heights_mm) {
  std::vector<double> areas;
  for (const double height : heights_mm) {
    double twice_area = 0;
    for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
      const Eigen::Vector3d corners[3] = {Corner(positions, triangles, f, 0),
                                          Corner(positions, triangles, f, 1),
                                          Corner(positions, triangles, f, 2)};
      twice_area += TwiceCutArea(corners, height);
    }
    areas.push_back(twice_area / 2);
  }
  return areas;
}

Eigen::Index CountSelfIntersections(const Positions& positions, const TriangleIndices& triangles) {
  const std::vector<Box> boxes = BoxesOf(positions, triangles);
  std::vector<Eigen::Index> by_begin(boxes.size());
  std::iota(by_begin.begin(), by_begin.end(), 0);
  const auto begin = [&](Eigen::Index f) { return boxes[static_cast<size_t>(f)].min().x(); };
  const auto end = [&](Eigen::Index f) { return boxes[static_cast<size_t>(f)].max().x(); };
  std::sort(by_begin.begin(), by_begin.end(),
            [&](Eigen::Index a, Eigen::Index b) { return begin(a) < begin(b); });
  Eigen::Index count = 0;
  for (size_t i = 0; i < by_begin.size(); ++i) {
    const Eigen::Index a = by_begin[i];
    // Sorted by where their boxes begin along x: past the first that begins behind the end of `a`
    // none meets it.
    for (size_t j = i + 1; j < by_begin.size() && begin(by_begin[j]) <= end(a); ++j) {
      const Eigen::Index b = by_begin[j];
      if (boxes[static_cast<size_t>(a)].intersects(boxes[static_cast<size_t>(b)]) &&
          !ShareVertex(triangles, a, b) && TrianglesIntersect(positions, triangles, a, b)) {
        ++count;
      }
    }
  }
  return count;
}

}  // namespace tissueform
