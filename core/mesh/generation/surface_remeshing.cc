// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_remeshing.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/generation/remeshing_passes.h"
#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/generation/triangle_intersections.h"
#include "core/mesh/surface_validation.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// A repair makes edges this much shorter, this many edges round what intersects.
constexpr double kRepairFactor = 0.7;
constexpr double kRepairReach = 2;

absl::Status CheckOptions(const RemeshingOptions& options) {
  const auto is_length = [](double length) { return length > 0 && std::isfinite(length); };
  if (!is_length(options.edge_mm)) {
    return absl::InvalidArgumentError(
        absl::StrCat("edge length ", options.edge_mm, " mm is not above 0; give one in mm"));
  }
  for (const FineRegion& region : options.fine_regions) {
    if (is_length(region.edge_mm) && region.radius_mm >= 0) continue;
    return absl::InvalidArgumentError(absl::StrCat("a fine region has edge length ", region.edge_mm,
                                                   " mm and radius ", region.radius_mm,
                                                   " mm; give both in mm"));
  }
  return absl::OkStatus();
}

absl::Status CheckClosed(const TriangleMesh& surface) {
  SurfaceReport report = ValidateTriangleMesh(surface);
  // Triangles without area go away; the rest has to be right.
  for (const MeshDefect& defect : report.defects) {
    if (defect.kind == "open_edges" || defect.kind == "non_manifold_edges" ||
        defect.kind == "turned_triangles" || defect.kind == "non_finite_vertices") {
      return absl::InvalidArgumentError(
          absl::StrCat("the surface cannot be remeshed: ", defect.explanation));
    }
  }
  return absl::OkStatus();
}

// Triangles that go through others or have no area.
std::vector<Eigen::Index> BadTriangles(const TriangleMesh& mesh,
                                       const TriangleIntersections& intersections) {
  std::vector<Eigen::Index> bad = DegenerateTriangles(mesh);
  for (const auto& [a, b] : intersections.pairs) {
    bad.push_back(a);
    bad.push_back(b);
  }
  std::sort(bad.begin(), bad.end());
  bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
  return bad;
}

// The same options with shorter edges round the bad triangles.
RemeshingOptions FinerAround(const TriangleMesh& mesh, const std::vector<Eigen::Index>& bad,
                             const RemeshingOptions& options) {
  RemeshingOptions finer = options;
  for (const Eigen::Index f : bad) {
    Vector3d centre = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) centre += mesh.positions().row(mesh.triangles()(f, k)).transpose();
    centre /= 3;
    const double length = WantedLength(options, centre);
    finer.fine_regions.push_back({centre, kRepairReach * length, kRepairFactor * length});
  }
  return finer;
}

absl::StatusOr<RemeshedSurface> RemeshAndRepair(const TriangleMesh& surface,
                                                const RemeshingOptions& options) {
  RemeshingOptions current = options;
  std::vector<int64_t> repaired_pairs;
  const OldSurface old(surface);
  while (true) {
    // Always from the old surface: what has gone through itself once does not come apart again.
    TriangleMesh mesh = RemeshOnce(surface, old, current);
    const TriangleIntersections intersections = FindTriangleIntersections(mesh);
    const std::vector<Eigen::Index> bad = BadTriangles(mesh, intersections);
    if (bad.empty()) return RemeshedSurface{std::move(mesh), std::move(repaired_pairs)};
    repaired_pairs.push_back(static_cast<int64_t>(intersections.pairs.size()));
    if (static_cast<int>(repaired_pairs.size()) > options.max_repairs) {
      return absl::InvalidArgumentError(
          absl::StrCat("the remeshed surface still has ", intersections.pairs.size(),
                       " pairs of triangles that go through each other after ", options.max_repairs,
                       " repairs; request shorter edges, or smooth the surface"));
    }
    current = FinerAround(mesh, bad, current);
  }
}

}  // namespace

absl::StatusOr<RemeshedSurface> RemeshSurface(const TriangleMesh& surface,
                                              const RemeshingOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(CheckClosed(surface));
  return RemeshAndRepair(surface, options);
}

}  // namespace tissueform
