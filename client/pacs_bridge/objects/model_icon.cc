// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/model_icon.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Vector3f;

constexpr float kDarkest = 60;
constexpr float kBrightest = 250;

// Rows: to the right of the picture, down, towards the observer.
Eigen::Matrix3f ToPicture(const HeadFrame& frame) {
  const Eigen::Vector3d towards = (frame.ToLps() * Eigen::Vector3d(-0.6, -1, 0.1)).normalized();
  const Eigen::Vector3d right = frame.superior.cross(towards).normalized();
  Eigen::Matrix3d rows;
  rows << right.transpose(), right.cross(towards).transpose(), towards.transpose();
  return rows.cast<float>();
}

// The vertices in pixels of the picture, with a border of one.
FloatPositions InPixels(const FloatPositions& positions, const HeadFrame& frame) {
  FloatPositions seen = positions * ToPicture(frame).transpose();
  const Eigen::RowVector3f low = seen.colwise().minCoeff();
  const Eigen::RowVector3f high = seen.colwise().maxCoeff();
  const float widest = std::max((high - low).head<2>().maxCoeff(), 1e-6F);
  const Eigen::RowVector3f middle = (low + high) / 2;
  seen = (seen.rowwise() - middle) * ((kIconPixels - 2) / widest);
  seen.leftCols<2>().array() += (kIconPixels - 1) / 2.0F;
  return seen;
}

class IconPainter {
 public:
  void Paint(const Vector3f& a, const Vector3f& b, const Vector3f& c) {
    const Vector3f normal = (b - a).cross(c - a);
    const float area = normal.z();
    if (std::abs(area) < 1e-9F) return;
    const auto shade = static_cast<uint8_t>(kDarkest + (kBrightest - kDarkest) *
                                                           std::abs(normal.z()) / normal.norm());
    const Vector3f low = a.cwiseMin(b).cwiseMin(c);
    const Vector3f high = a.cwiseMax(b).cwiseMax(c);
    for (int y = First(low.y()); y <= Last(high.y()); ++y) {
      for (int x = First(low.x()); x <= Last(high.x()); ++x) {
        const auto side = [&](const Vector3f& p, const Vector3f& q) {
          return ((q.x() - p.x()) * (static_cast<float>(y) - p.y()) -
                  (q.y() - p.y()) * (static_cast<float>(x) - p.x())) /
                 area;
        };
        const Vector3f part(side(b, c), side(c, a), side(a, b));
        if (part.minCoeff() < 0) continue;
        Put(x, y, part.x() * a.z() + part.y() * b.z() + part.z() * c.z(), shade);
      }
    }
  }

  std::vector<uint8_t> Take() { return std::move(pixels_); }

 private:
  static int First(float low) { return std::max(0, static_cast<int>(std::ceil(low))); }
  static int Last(float high) {
    return std::min(kIconPixels - 1, static_cast<int>(std::floor(high)));
  }
  void Put(int x, int y, float nearness, uint8_t shade) {
    const auto i = static_cast<size_t>(y) * kIconPixels + static_cast<size_t>(x);
    if (nearness <= nearness_[i]) return;
    nearness_[i] = nearness;
    pixels_[i] = shade;
  }

  static constexpr size_t kCount = size_t{kIconPixels} * kIconPixels;
  std::vector<uint8_t> pixels_ = std::vector<uint8_t>(kCount, 0);
  std::vector<float> nearness_ = std::vector<float>(kCount, std::numeric_limits<float>::lowest());
};

}  // namespace

std::vector<uint8_t> DrawModelIcon(const FloatPositions& positions,
                                   const TriangleIndices& triangles, const HeadFrame& frame) {
  IconPainter painter;
  if (positions.rows() == 0) return painter.Take();
  const FloatPositions seen = InPixels(positions, frame);
  for (const auto& corners : triangles.rowwise()) {
    painter.Paint(seen.row(corners[0]), seen.row(corners[1]), seen.row(corners[2]));
  }
  return painter.Take();
}

}  // namespace tissueform
