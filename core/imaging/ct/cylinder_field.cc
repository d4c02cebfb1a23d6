// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/cylinder_field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>

namespace tissueform {
namespace {

constexpr double kRimVoxels = 1.5;
// Points of the outline count as on the circle so near to it, and of a cylinder so many do.
constexpr double kOnCircleVoxels = 1.5;
constexpr double kLeastOnCircle = 0.9;
// Noise leaves the filling alone, but single damaged pixels may not.
constexpr double kMostOutside = 0.001;
constexpr double kLeastAtRim = 0.4;
constexpr int kRounds = 6;
constexpr size_t kLeastPoints = 16;

// How many voxels of each column along an axis differ from the filling.
struct Projection {
  int axis = 2;
  std::array<int, 2> size = {0, 0};
  int length = 0;                                        // voxels of a column
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();  // along the two axes
  std::vector<int> counts;                               // first axis fastest

  int At(int a, int b) const {
    return counts[static_cast<size_t>(a) + static_cast<size_t>(size[0]) * static_cast<size_t>(b)];
  }
  double VoxelMm() const { return spacing_mm.maxCoeff(); }
  Eigen::Vector2d Place(int a, int b) const {
    return spacing_mm.cwiseProduct(Eigen::Vector2d(a, b));
  }
  bool HasBareCorners() const {
    return At(0, 0) == 0 && At(size[0] - 1, 0) == 0 && At(0, size[1] - 1) == 0 &&
           At(size[0] - 1, size[1] - 1) == 0;
  }
};

Projection EmptyProjection(const CtVolume& volume, int axis) {
  const auto other = std::array<std::array<size_t, 2>, 3>{{{1, 2}, {0, 2}, {0, 1}}};
  const auto [a, b] = other[static_cast<size_t>(axis)];
  Projection projection;
  projection.axis = axis;
  projection.size = {volume.size[a], volume.size[b]};
  projection.length = volume.size[static_cast<size_t>(axis)];
  projection.spacing_mm = {volume.spacing_mm[static_cast<Eigen::Index>(a)],
                           volume.spacing_mm[static_cast<Eigen::Index>(b)]};
  projection.counts.assign(
      static_cast<size_t>(volume.size[a]) * static_cast<size_t>(volume.size[b]), 0);
  return projection;
}

std::array<Projection, 3> Project(const CtVolume& volume) {
  std::array<Projection, 3> along = {EmptyProjection(volume, 0), EmptyProjection(volume, 1),
                                     EmptyProjection(volume, 2)};
  const auto& [ni, nj, nk] = volume.size;
  const int16_t outside = volume.hu.front();
  const int16_t* value = volume.hu.data();
  for (int k = 0; k < nk; ++k) {
    int* const along_j = along[1].counts.data() + int64_t{k} * ni;
    for (int j = 0; j < nj; ++j) {
      int* const along_k = along[2].counts.data() + int64_t{j} * ni;
      int in_row = 0;
      for (int i = 0; i < ni; ++i, ++value) {
        const int differs = *value != outside ? 1 : 0;
        in_row += differs;
        along_j[i] += differs;
        along_k[i] += differs;
      }
      along[0].counts[static_cast<size_t>(j + int64_t{nj} * k)] += in_row;
    }
  }
  return along;
}

// Where rows and columns enter and leave what differs, but not at the sides of the box.
std::vector<Eigen::Vector2d> OutlineOf(const Projection& projection) {
  std::vector<Eigen::Vector2d> points;
  for (const size_t along : {size_t{0}, size_t{1}}) {
    const int across = projection.size[1 - along];
    const int length = projection.size[along];
    for (int line = 0; line < across; ++line) {
      const auto differs = [&](int at) {
        return (along == 0 ? projection.At(at, line) : projection.At(line, at)) != 0;
      };
      int first = 0;
      int last = length - 1;
      while (first < length && !differs(first)) ++first;
      while (last > first && !differs(last)) --last;
      if (first > last) continue;
      for (const int at : {first, last}) {
        if (at == 0 || at == length - 1) continue;
        points.push_back(along == 0 ? projection.Place(at, line) : projection.Place(line, at));
      }
    }
  }
  return points;
}

struct Circle {
  Eigen::Vector2d center_mm = Eigen::Vector2d::Zero();
  double radius_mm = 0;

  double BeyondMm(const Eigen::Vector2d& place) const {
    return (place - center_mm).norm() - radius_mm;
  }
};

// Least squares in x^2 + y^2 = 2 a x + 2 b y + c.
Circle Fit(const std::vector<Eigen::Vector2d>& points) {
  Eigen::MatrixX3d rows(static_cast<Eigen::Index>(points.size()), 3);
  Eigen::VectorXd squares(rows.rows());
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    const Eigen::Vector2d& p = points[static_cast<size_t>(r)];
    rows.row(r) << 2 * p.x(), 2 * p.y(), 1;
    squares[r] = p.squaredNorm();
  }
  const Eigen::Vector3d found = rows.colPivHouseholderQr().solve(squares);
  const Eigen::Vector2d center = found.head<2>();
  return {center, std::sqrt(std::max(0.0, found[2] + center.squaredNorm()))};
}

// Where air has the filling's value, too, parts of the outline are a face's: they lie inside the
// circle, and are left out round by round.
std::optional<Circle> FitOutline(const std::vector<Eigen::Vector2d>& outline, double voxel_mm) {
  std::vector<Eigen::Vector2d> points = outline;
  for (int round = 0; round < kRounds; ++round) {
    if (points.size() < kLeastPoints) return std::nullopt;
    const Circle circle = Fit(points);
    const auto off = std::count_if(points.begin(), points.end(), [&](const auto& p) {
      return std::abs(circle.BeyondMm(p)) > kOnCircleVoxels * voxel_mm;
    });
    const auto allowed = (1 - kLeastOnCircle) * static_cast<double>(points.size());
    if (static_cast<double>(off) <= allowed) return circle;
    points.erase(std::remove_if(points.begin(), points.end(),
                                [&](const auto& p) { return circle.BeyondMm(p) < -voxel_mm; }),
                 points.end());
  }
  return std::nullopt;
}

bool IsCylinder(const Projection& projection, const Circle& circle) {
  const double voxel_mm = projection.VoxelMm();
  int64_t marked = 0;
  int64_t outside = 0;
  int64_t at_rim = 0;
  int64_t of_rim = 0;
  for (int b = 0; b < projection.size[1]; ++b) {
    for (int a = 0; a < projection.size[0]; ++a) {
      const int count = projection.At(a, b);
      const double beyond = circle.BeyondMm(projection.Place(a, b)) / voxel_mm;
      if (count != 0) ++marked;
      if (count != 0 && beyond > kOnCircleVoxels) ++outside;
      if (beyond < -2 * kRimVoxels || beyond > -kRimVoxels) continue;
      at_rim += count;
      of_rim += projection.length;
    }
  }
  return of_rim > 0 && static_cast<double>(outside) <= kMostOutside * static_cast<double>(marked) &&
         static_cast<double>(at_rim) >= kLeastAtRim * static_cast<double>(of_rim);
}

}  // namespace

std::optional<CylinderField> FindCylinderField(const CtVolume& volume) {
  if (volume.hu.empty()) return std::nullopt;
  const std::array<Projection, 3> along = Project(volume);
  for (const size_t axis : {size_t{2}, size_t{1}, size_t{0}}) {
    const Projection& projection = along[axis];
    if (!projection.HasBareCorners()) continue;
    const std::optional<Circle> circle = FitOutline(OutlineOf(projection), projection.VoxelMm());
    if (!circle || !IsCylinder(projection, *circle)) continue;
    return CylinderField{.axis = projection.axis,
                         .center_voxels = circle->center_mm.cwiseQuotient(projection.spacing_mm),
                         .radius_mm = circle->radius_mm - kRimVoxels * projection.VoxelMm(),
                         .outside_value = volume.hu.front()};
  }
  return std::nullopt;
}

std::vector<uint8_t> CrossSectionOf(const CylinderField& field, const CtVolume& volume) {
  const Projection plane = EmptyProjection(volume, field.axis);
  const Circle circle{field.center_voxels.cwiseProduct(plane.spacing_mm), field.radius_mm};
  std::vector<uint8_t> section;
  section.reserve(plane.counts.size());
  for (int b = 0; b < plane.size[1]; ++b) {
    for (int a = 0; a < plane.size[0]; ++a) {
      section.push_back(circle.BeyondMm(plane.Place(a, b)) <= 0 ? 1 : 0);
    }
  }
  return section;
}

}  // namespace tissueform
