// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/solid_voxels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/mesh/generation/surface_distance.h"

namespace tissueform {
namespace {

// Bones from one image share the voxels of their border.
constexpr double kLargestOverlapFraction = 0.05;
constexpr char kTurnAdvice[] =
    "its triangles face inward or the surface is mirrored; turn the triangles (\"flip\": true) if "
    "the coordinates are right";

constexpr int kAgreeingRays = 4;
constexpr double kBorderVoxels = 2;

// Rays pass beside the voxels' centers by this part of a voxel, so that none runs along an edge of
// a surface whose corners are at round coordinates.
constexpr double kBesideU = 1.37e-4;
constexpr double kBesideV = 2.11e-4;

struct Crossing {
  double depth = 0;    // along the ray, in voxels
  int8_t outward = 0;  // 1: the ray leaves the surface here when it runs to larger coordinates
};

// All rays along one axis: those through the voxels' centers of the plane of the other two.
class RaysAlongAxis {
 public:
  RaysAlongAxis(const GridGeometry& geometry, const OpenBox& open, int axis)
      : geometry_(geometry), w_(axis), u_((axis + 1) % 3), v_((axis + 2) % 3) {
    if (open.low[static_cast<size_t>(axis)]) low_ = geometry.ToVoxels(open.box.min())[axis];
    if (open.high[static_cast<size_t>(axis)]) high_ = geometry.ToVoxels(open.box.max())[axis];
    crossings_.resize(static_cast<size_t>(Size(u_)) * static_cast<size_t>(Size(v_)));
  }

  void Add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    const auto range = [&](int axis, double beside) {
      const auto [low, high] = std::minmax({a[axis], b[axis], c[axis]});
      return std::pair(std::max(0, static_cast<int>(std::ceil(low - beside))),
                       std::min(Size(axis) - 1, static_cast<int>(std::floor(high - beside))));
    };
    const double twice_area = Cross(a, b, c[u_], c[v_]);
    if (twice_area == 0) return;
    const auto [first_u, last_u] = range(u_, kBesideU);
    const auto [first_v, last_v] = range(v_, kBesideV);
    for (int v = first_v; v <= last_v; ++v) {
      for (int u = first_u; u <= last_u; ++u) AddRay(a, b, c, twice_area, u, v);
    }
  }

  // Adds the votes of both directions along the axis for the voxels of the rays with this v.
  void Vote(int v, VoxelGrid<int8_t>* votes) {
    for (int u = 0; u < Size(u_); ++u) {
      std::vector<Crossing>& ray = RayAt(u, v);
      std::sort(ray.begin(), ray.end(),
                [](const Crossing& a, const Crossing& b) { return a.depth < b.depth; });
      int after = 0;
      for (const Crossing& crossing : ray) after += crossing.outward;
      after += CloseAtTheEnds(after, &ray);
      int before = 0;
      auto next = ray.begin();
      for (int w = 0; w < Size(w_); ++w) {
        for (; next != ray.end() && next->depth < w; ++next) {
          after -= next->outward;
          before -= next->outward;
        }
        std::array<int, 3> at{};
        at[static_cast<size_t>(u_)] = u;
        at[static_cast<size_t>(v_)] = v;
        at[static_cast<size_t>(w_)] = w;
        int8_t& vote = votes->At(at[0], at[1], at[2]);
        vote = static_cast<int8_t>(vote + std::clamp(after, -1, 1) + std::clamp(before, -1, 1));
      }
    }
  }

  int NumSheets() const { return Size(v_); }

 private:
  int Size(int axis) const { return geometry_.size[static_cast<size_t>(axis)]; }
  std::vector<Crossing>& RayAt(int u, int v) {
    return crossings_[static_cast<size_t>(u) +
                      static_cast<size_t>(v) * static_cast<size_t>(Size(u_))];
  }
  double Cross(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double u, double v) const {
    return (b[u_] - a[u_]) * (v - a[v_]) - (b[v_] - a[v_]) * (u - a[u_]);
  }
  void AddRay(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
              double twice_area, int u, int v) {
    const double at_u = u + kBesideU;
    const double at_v = v + kBesideV;
    const double of_a = Cross(b, c, at_u, at_v) / twice_area;
    const double of_b = Cross(c, a, at_u, at_v) / twice_area;
    const double of_c = 1 - of_a - of_b;
    if (of_a < 0 || of_b < 0 || of_c < 0) return;
    RayAt(u, v).push_back(
        {of_a * a[w_] + of_b * b[w_] + of_c * c[w_], static_cast<int8_t>(twice_area > 0 ? 1 : -1)});
  }

  // Adds the crossing that an open end lacks, and returns its direction.
  int CloseAtTheEnds(int balance, std::vector<Crossing>* ray) const {
    if (balance < 0 && high_) ray->push_back({*high_, 1});
    if (balance > 0 && low_) ray->insert(ray->begin(), {*low_, -1});
    return balance < 0 && high_ ? 1 : balance > 0 && low_ ? -1 : 0;
  }

  const GridGeometry geometry_;
  const int w_;
  const int u_;
  const int v_;
  std::optional<double> low_;  // where the surface is open, in voxels
  std::optional<double> high_;
  std::vector<std::vector<Crossing>> crossings_;
};

void VoteAlongAxis(const Positions& in_voxels, const TriangleIndices& triangles, int axis,
                   int threads, const OpenBox& open, VoxelGrid<int8_t>* votes) {
  RaysAlongAxis rays(votes->geometry, open, axis);
  for (const auto& t : triangles.rowwise()) {
    rays.Add(in_voxels.row(t[0]), in_voxels.row(t[1]), in_voxels.row(t[2]));
  }
  ParallelFor(threads, rays.NumSheets(), 4, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index v = begin; v < end; ++v) rays.Vote(static_cast<int>(v), votes);
  });
}

}  // namespace

bool OpenBox::any() const { return low[0] || low[1] || low[2] || high[0] || high[1] || high[2]; }

SolidVoxels FindSolidVoxels(const TriangleMesh& surface, const GridGeometry& geometry, int threads,
                            const OpenBox& open) {
  Positions in_voxels(surface.num_vertices(), 3);
  for (Eigen::Index v = 0; v < surface.num_vertices(); ++v) {
    in_voxels.row(v) = geometry.ToVoxels(surface.positions().row(v).transpose()).transpose();
  }
  VoxelGrid<int8_t> votes(geometry);
  for (const int axis : {0, 1, 2}) {
    VoteAlongAxis(in_voxels, surface.triangles(), axis, threads, open, &votes);
  }
  SolidVoxels solid;
  solid.inside = MaskWhere(votes, [](int8_t vote) { return vote >= kAgreeingRays; });
  solid.inside_mm3 = VolumeMm3(solid.inside);
  const auto turned = std::count_if(votes.values.begin(), votes.values.end(),
                                    [](int8_t vote) { return vote <= -kAgreeingRays; });
  solid.turned_mm3 = static_cast<double>(turned) * VoxelVolumeMm3(geometry);
  return solid;
}

absl::StatusOr<LabelGrid> SolidOf(const TriangleMesh& mesh, const std::string& what,
                                  const GridGeometry& geometry, int threads, const OpenBox& open) {
  SolidVoxels solid = FindSolidVoxels(mesh, geometry, threads, open);
  if (solid.turned_mm3 > solid.inside_mm3) {
    return absl::InvalidArgumentError(absl::StrCat(what, " is inside out: ", kTurnAdvice));
  }
  constexpr double kSmallestSolidMm3 = 100;
  if (solid.inside_mm3 < kSmallestSolidMm3) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s encloses %.0f mm3 of the head: it is open, in another place or in another "
        "unit; close it, or have it wrapped (\"wrap_mm\")",
        what, solid.inside_mm3));
  }
  return std::move(solid.inside);
}

absl::Status MarkSolid(const LabelGrid& inside, const std::string& what, uint8_t label,
                       LabelGrid* labels) {
  int64_t shared = 0;
  int64_t all = 0;
  for (size_t i = 0; i < inside.values.size(); ++i) {
    if (inside.values[i] == 0) continue;
    ++all;
    if (labels->values[i] != 0) ++shared;
    if (labels->values[i] == 0) labels->values[i] = label;
  }
  if (static_cast<double>(shared) <= kLargestOverlapFraction * static_cast<double>(all)) {
    return absl::OkStatus();
  }
  const double cm3 = VoxelVolumeMm3(labels->geometry) / 1000;
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s overlaps with the bones given before it in %.1f cm3 of its %.1f cm3: each piece must "
      "be given once",
      what, static_cast<double>(shared) * cm3, static_cast<double>(all) * cm3));
}

FloatGrid DistancesNearBorder(const LabelGrid& inside, const TriangleMesh& surface, int threads) {
  const GridGeometry& geometry = inside.geometry;
  const auto limit_mm = static_cast<float>(kBorderVoxels * geometry.spacing_mm);
  FloatGrid distances(geometry);
  // The border runs between voxels: its voxels are within one and a half of those to be measured.
  const FloatGrid to_inside = DistanceMm(inside);
  const FloatGrid to_outside = DistanceMm(MaskWhere(inside, [](uint8_t v) { return v == 0; }));
  std::vector<size_t> near;
  std::vector<Eigen::Vector3d> places;
  ForEachVoxel(LabelGrid(geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const bool is_inside = inside.values[index] != 0;
    distances.values[index] = is_inside ? limit_mm : -limit_mm;
    if (std::max(to_inside.values[index], to_outside.values[index]) > limit_mm) return;
    near.push_back(index);
    places.push_back(place);
  });
  Positions points(static_cast<Eigen::Index>(places.size()), 3);
  for (size_t i = 0; i < places.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = places[i];
  const Eigen::VectorXd measured = DistancesToSurface(points, surface, threads);
  for (size_t i = 0; i < near.size(); ++i) {
    const auto mm = std::min(static_cast<float>(measured[static_cast<Eigen::Index>(i)]), limit_mm);
    distances.values[near[i]] = inside.values[near[i]] != 0 ? mm : -mm;
  }
  return distances;
}

}  // namespace tissueform
