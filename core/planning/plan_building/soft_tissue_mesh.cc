// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/soft_tissue_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/generation/tetrahedralization.h"
#include "core/mesh/surface_parts.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// The isosurface keeps off voxel centres by this part of the spacing: remeshing starts from
// triangles with area, at the cost of a twentieth of a voxel.
constexpr double kClearance = 0.05;

// With five tets are no better than with four, and with three a little worse (docs/performance.md).
constexpr int kRemeshingIterations = 4;

absl::Status CheckOptions(const SoftTissueMeshOptions& options) {
  if (options.interior_edge_factor >= 1 && options.max_attempts >= 1 && options.retry_factor > 0 &&
      options.retry_factor < 1 && options.min_dihedral_deg >= 0 && options.min_dihedral_deg <= 18) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "meshing soft tissue needs an interior edge factor of 1 or more, an attempt or more, a retry "
      "factor between 0 and 1, and a smallest dihedral angle between 0 and 18 degrees");
}

absl::Status Announce(const SoftTissueMeshOptions& options, absl::string_view stage) {
  return options.on_stage ? options.on_stage(stage) : absl::OkStatus();
}

absl::StatusOr<TriangleMesh> Isosurface(const VoxelGrid<float>& heights,
                                        const SoftTissueMeshOptions& options) {
  SurfaceExtractionOptions extraction;
  extraction.clearance = static_cast<float>(kClearance * heights.geometry.spacing_mm);
  extraction.min_cavity_volume_mm3 = options.min_cavity_volume_mm3;
  return ExtractSurface(heights, extraction);
}

RemeshingOptions Remeshing(const SoftTissueMeshOptions& options, double shrinking) {
  RemeshingOptions remeshing;
  remeshing.edge_mm = shrinking * options.edge_mm;
  remeshing.fine_regions = options.fine_regions;
  remeshing.threads = options.threads;
  remeshing.iterations = kRemeshingIterations;
  for (FineRegion& region : remeshing.fine_regions) region.edge_mm *= shrinking;
  return remeshing;
}

TetrahedralizationOptions Filling(const SoftTissueMeshOptions& options, double edge_mm) {
  TetrahedralizationOptions filling;
  filling.min_dihedral_deg = options.min_dihedral_deg;
  filling.max_tet_volume_mm3 = RegularTetVolume(options.interior_edge_factor * edge_mm);
  filling.limits = options.limits;
  return filling;
}

SurfaceDistances Summarize(Eigen::VectorXd distances) {
  std::sort(distances.begin(), distances.end());
  return {
      .mean_mm = distances.mean(),
      .p99_mm = PercentileOfRising({distances.data(), static_cast<size_t>(distances.size())}, 99),
      .max_mm = distances[distances.size() - 1]};
}

Eigen::Index CountBelow(const TetMesh& mesh, double degrees) {
  const auto angles = DihedralAnglesDeg(mesh.positions(), mesh.tets());
  return (angles.rowwise().minCoeff().array() < degrees).count();
}

double EnclosedVolume(const TriangleMesh& surface) {
  double volume = 0;
  for (const double part : FindSurfaceParts(surface).volumes_mm3) volume += part;
  return volume;
}

void Measure(const TriangleMesh& isosurface, int threads, SoftTissueMesh* made) {
  SoftTissueMeshReport& report = made->report;
  MeasureTets(made);
  const auto parts = FindSurfaceParts(made->surface).volumes_mm3;
  report.cavities = std::count_if(parts.begin(), parts.end(), [](double v) { return v < 0; });
  report.grid_volume_mm3 = EnclosedVolume(isosurface);
  report.volume_ratio = report.quality.total_volume_mm3 / report.grid_volume_mm3;
  report.to_isosurface =
      Summarize(DistancesToSurface(made->surface.positions(), isosurface, threads));
  report.from_isosurface =
      Summarize(DistancesToSurface(isosurface.positions(), made->surface, threads));
}

absl::StatusOr<SoftTissueMesh> Attempt(const TriangleMesh& isosurface,
                                       const SoftTissueMeshOptions& options, double shrinking) {
  TF_RETURN_IF_ERROR(Announce(options, "remeshing the surface"));
  const RemeshingOptions remeshing = Remeshing(options, shrinking);
  TF_ASSIGN_OR_RETURN(RemeshedSurface remeshed, RemeshSurface(isosurface, remeshing));
  TF_RETURN_IF_ERROR(Announce(options, "filling the surface with tets"));
  TF_ASSIGN_OR_RETURN(Tetrahedralization filled,
                      Tetrahedralize(remeshed.mesh, Filling(options, remeshing.edge_mm)));
  const TetMesh& mesh = filled.mesh;
  if (FindConnectedComponents(mesh.tets(), mesh.num_vertices()).count != 1) {
    return absl::InvalidArgumentError("the mesh is not connected; request shorter edges");
  }
  SoftTissueMeshReport report;
  report.edge_mm = remeshing.edge_mm;
  report.repaired_pairs = std::move(remeshed.repaired_pairs);
  return SoftTissueMesh{std::move(filled.mesh), std::move(remeshed.mesh), std::move(report)};
}

}  // namespace

void MeasureTets(SoftTissueMesh* made) {
  made->report.surface_vertices = made->surface.num_vertices();
  made->report.quality = SummarizeTetQuality(made->mesh);
  made->report.tets_below_3_deg = CountBelow(made->mesh, 3);
}

absl::StatusOr<SoftTissueMesh> MeshSoftTissue(const VoxelGrid<float>& heights,
                                              const SoftTissueMeshOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(Announce(options, "surface of the soft tissue"));
  TF_ASSIGN_OR_RETURN(const TriangleMesh isosurface, Isosurface(heights, options));
  absl::Status stopped;  // by the caller, independent of the returned error
  SoftTissueMeshOptions watched = options;
  watched.on_stage = [&](absl::string_view stage) { return stopped = Announce(options, stage); };
  double shrinking = 1;
  for (int attempt = 1;; ++attempt, shrinking *= options.retry_factor) {
    absl::StatusOr<SoftTissueMesh> made = Attempt(isosurface, watched, shrinking);
    // Shorter edges follow the isosurface closer and so part walls that longer ones push through
    // each other. That helps against bad input of the fill, not against limits or a caller's stop.
    const bool may_help = stopped.ok() && absl::IsInvalidArgument(made.status());
    if (!made.ok() && may_help && attempt < options.max_attempts) continue;
    TF_RETURN_IF_ERROR(made.status());
    made->report.attempts = attempt;
    TF_RETURN_IF_ERROR(Announce(options, "measuring the mesh"));
    Measure(isosurface, options.threads, &*made);
    return made;
  }
}

}  // namespace tissueform
