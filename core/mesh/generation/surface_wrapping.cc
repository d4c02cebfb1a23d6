// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_wrapping.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/mesh/border_loops.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/generation/wrap_call.h"
#include "core/mesh/surface_validation.h"

namespace tissueform {
namespace {

// Measured on spheres, boxes and jaws: triangles of the wrap times alpha squared over the area.
constexpr double kTrianglesPerAlphaArea = 1.6;

// A point that lies deeper in the wrap than this many offsets is covered and not only wrapped.
constexpr double kCoveredDepth = 1.5;

// The volume of a sheet is twice the offset times its area; rounded borders add to it.
constexpr double kSheetVolume = 1.25;

Eigen::RowVector3d Corner(const TriangleMesh& mesh, Eigen::Index f, int corner) {
  return mesh.positions().row(mesh.triangles()(f, corner));
}

// The corners, the centroid and, where wanted, the edges' midpoints of all triangles.
Positions SamplePoints(const TriangleMesh& mesh, bool with_midpoints) {
  const int per_triangle = with_midpoints ? 7 : 4;
  Positions points(mesh.num_triangles() * per_triangle, 3);
  for (Eigen::Index f = 0; f < mesh.num_triangles(); ++f) {
    const Eigen::RowVector3d a = Corner(mesh, f, 0);
    const Eigen::RowVector3d b = Corner(mesh, f, 1);
    const Eigen::RowVector3d c = Corner(mesh, f, 2);
    Eigen::Index row = f * per_triangle;
    for (const Eigen::RowVector3d& p : {a, b, c}) points.row(row++) = p;
    points.row(row++) = (a + b + c) / 3;
    if (!with_midpoints) continue;
    points.row(row++) = (a + b) / 2;
    points.row(row++) = (b + c) / 2;
    points.row(row++) = (c + a) / 2;
  }
  return points;
}

absl::Status CheckSize(const SurfaceReport& report, double offset_mm) {
  const double triangles = EstimatedWrapTriangles(report.area_mm2, offset_mm);
  if (triangles <= static_cast<double>(kMaxWrapTriangles)) return absl::OkStatus();
  const double enough = offset_mm * std::sqrt(triangles / static_cast<double>(kMaxWrapTriangles));
  return absl::InvalidArgumentError(absl::StrFormat(
      "a wrap with an offset of %g mm would have about %.1f million triangles; the limit is %.1f "
      "million: use an offset of %.2g mm or more",
      offset_mm, triangles / 1e6, static_cast<double>(kMaxWrapTriangles) / 1e6, enough * 1.05));
}

absl::Status CheckWrappable(const TriangleMesh& surface, double offset_mm) {
  if (!(offset_mm > 0) || !std::isfinite(offset_mm)) {
    return absl::InvalidArgumentError("the offset of the wrap must be a positive length in mm");
  }
  const SurfaceReport report = ValidateTriangleMesh(surface);
  if (const MeshDefect* bad = report.Find("non_finite_vertices")) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot wrap the surface: ", bad->count,
                     " vertices have coordinates that are not finite numbers"));
  }
  if (!(report.area_mm2 > 0)) {
    return absl::InvalidArgumentError("cannot wrap the surface: no triangle has an area");
  }
  return CheckSize(report, offset_mm);
}

void MeasureDistances(const TriangleMesh& surface, const WrappingOptions& options,
                      WrappedSurface* wrapped) {
  wrapped->largest_to_surface_mm =
      DistancesToSurface(SamplePoints(wrapped->mesh, true), surface, options.threads).maxCoeff();
  const Eigen::VectorXd depth =
      DistancesToSurface(SamplePoints(surface, false), wrapped->mesh, options.threads);
  wrapped->largest_from_surface_mm = depth.maxCoeff();
  wrapped->covered_fraction =
      (depth.array() > kCoveredDepth * options.offset_mm).cast<double>().mean();
}

}  // namespace

double EstimatedWrapTriangles(double area_mm2, double offset_mm) {
  const double alpha_mm = kAlphaPerOffset * offset_mm;
  // A shape smaller than alpha has a few dozen triangles.
  return 50 + kTrianglesPerAlphaArea * area_mm2 / (alpha_mm * alpha_mm);
}

double OffsetThatBridges(const TriangleMesh& surface) {
  double widest_mm = 0;
  for (const std::vector<int32_t>& loop : BorderLoops(surface)) {
    widest_mm = std::max(widest_mm, LoopWidthMm(surface, loop));
  }
  return widest_mm / (2 * kAlphaPerOffset);
}

absl::StatusOr<WrappedSurface> WrapSurface(const TriangleMesh& surface,
                                           const WrappingOptions& options) {
  TF_RETURN_IF_ERROR(CheckWrappable(surface, options.offset_mm));
  TF_ASSIGN_OR_RETURN(TriangleMesh mesh, CallAlphaWrap(surface, kAlphaPerOffset * options.offset_mm,
                                                       options.offset_mm, options.limits));
  WrappedSurface wrapped{.mesh = std::move(mesh)};
  MeasureDistances(surface, options, &wrapped);
  wrapped.volume_mm3 = ValidateTriangleMesh(wrapped.mesh).enclosed_volume_mm3;
  const SurfaceReport report = ValidateTriangleMesh(surface);
  wrapped.is_sheet = report.Find("open_edges") != nullptr && wrapped.covered_fraction == 0 &&
                     wrapped.volume_mm3 < kSheetVolume * 2 * options.offset_mm * report.area_mm2;
  return wrapped;
}

}  // namespace tissueform
