// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/skin_coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/anatomy/skin_regions.h"
#include "core/imaging/anatomy/skin_shell.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/surface_parts.h"

namespace tissueform {
namespace {

// As for the mesh: keeps the surface off the centres of voxels. HU.
constexpr float kClearanceHu = 20;

// Skin is so thick at least, and what is looser is hair.
constexpr double kBehindMm = 3;
constexpr int kBehindSteps = 6;

// Barycentres and areas of all triangles.
struct TriangleSizes {
  Positions middles;
  std::vector<double> areas_mm2;
};

TriangleSizes SizesOf(const TriangleMesh& surface) {
  TriangleSizes sizes;
  sizes.middles.resize(surface.num_triangles(), 3);
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    const auto corner = [&](int k) -> Eigen::Vector3d {
      return surface.positions().row(surface.triangles()(f, k));
    };
    sizes.middles.row(f) = (corner(0) + corner(1) + corner(2)) / 3;
    sizes.areas_mm2.push_back((corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 2);
  }
  return sizes;
}

// A vertex of the isosurface lies on an edge of the grid between two voxels: whether one of them is
// in the mask.
bool Touches(const LabelGrid& mask, const Eigen::Vector3d& vertex) {
  const Eigen::Vector3d at = mask.geometry.ToVoxels(vertex);
  Eigen::Index axis = 0;
  (at.array() - at.array().round()).abs().maxCoeff(&axis);
  for (const double end : {std::floor(at[axis]), std::ceil(at[axis])}) {
    Eigen::Vector3d voxel = at.array().round();
    voxel[axis] = end;
    const Eigen::Vector3i index = voxel.cast<int>();
    if (mask.geometry.Contains(index.x(), index.y(), index.z()) &&
        mask.At(index.x(), index.y(), index.z()) != 0) {
      return true;
    }
  }
  return false;
}

TriangleMesh KeepTriangles(const TriangleMesh& surface, const std::vector<bool>& kept) {
  SurfaceParts parts{.part_of_triangle = {}, .volumes_mm3 = {0, 0}};
  for (const bool keep : kept) parts.part_of_triangle.push_back(keep ? 1 : 0);
  return KeepParts(surface, parts, {false, true});
}

struct OuterSkin {
  TriangleMesh skin;
  std::optional<TriangleMesh> cut;  // what the scanner's circle or the CT's side makes of it
};

// The outer skin of the CT within the region of interest, without teeth that an open mouth exposes.
absl::StatusOr<OuterSkin> FindOuterSkin(const HeadSegmentation& head, const LabelGrid& outside_air,
                                        const Landmarks& landmarks, const RegionOfInterest& region,
                                        double tolerance_mm) {
  FloatGrid hu(head.hu.geometry);
  std::copy(head.hu.values.begin(), head.hu.values.end(), hu.values.begin());
  SurfaceExtractionOptions extraction;
  extraction.level = head.options.tissue_above_hu;
  extraction.clearance = kClearanceHu;
  extraction.min_cavity_volume_mm3 = std::numeric_limits<double>::infinity();
  TF_ASSIGN_OR_RETURN(const TriangleMesh surface, ExtractSurface(hu, extraction));
  const LabelGrid teeth = ExposedTeeth(head, outside_air, landmarks);
  std::vector<bool> is_outer;
  for (const auto& position : surface.positions().rowwise()) {
    is_outer.push_back(Touches(outside_air, position.transpose()) &&
                       !Touches(teeth, position.transpose()));
  }
  const std::vector<Plane> planes = region.planes();
  // Where the region's planes cut, the mesh ends up to the tolerance beside them; a thin ear that a
  // plane shaves shows it most.
  const double margin_mm = std::max(head.hu.geometry.spacing_mm, tolerance_mm);
  const TriangleSizes sizes = SizesOf(surface);
  const FloatGrid to_cut = head.cut.values.empty() ? FloatGrid() : DistanceMm(head.cut);
  const auto is_cut = [&](const Eigen::Vector3d& place) {
    return !to_cut.values.empty() && Interpolate(to_cut, place) <= margin_mm;
  };
  std::vector<bool> is_skin;
  std::vector<bool> is_end;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    const auto triangle = surface.triangles().row(f);
    const Eigen::Vector3d middle = sizes.middles.row(f);
    const bool within = is_outer[triangle[0]] && is_outer[triangle[1]] && is_outer[triangle[2]] &&
                        LeastHeightMm(planes, middle) >= margin_mm;
    is_end.push_back(within && is_cut(middle));
    is_skin.push_back(within && !is_end.back());
  }
  const auto any = [](const std::vector<bool>& of) {
    return std::find(of.begin(), of.end(), true) != of.end();
  };
  if (any(is_skin)) {
    OuterSkin outer{.skin = KeepTriangles(surface, is_skin), .cut = std::nullopt};
    if (any(is_end)) outer.cut = KeepTriangles(surface, is_end);
    return outer;
  }
  return absl::InvalidArgumentError(
      "the region of interest has no outer skin, or only skin that the CT's border does not "
      "cut; "
      "move its planes");
}

// The triangles of a mesh's boundary with a corner on skin.
absl::StatusOr<TriangleMesh> SkinOf(const MeshedSkin& mesh) {
  std::vector<bool> kept;
  for (const auto& triangle : mesh.surface.triangles().rowwise()) {
    kept.push_back(std::any_of(triangle.begin(), triangle.end(),
                               [&](int32_t v) { return mesh.regions.on_skin[v]; }));
  }
  if (std::find(kept.begin(), kept.end(), true) != kept.end()) {
    return KeepTriangles(mesh.surface, kept);
  }
  return absl::InvalidArgumentError(
      "the mesh's boundary has no skin; move the planes of "
      "the region of interest");
}

void Count(double area_mm2, double distance_mm, double tolerance_mm, const Eigen::Vector3d& place,
           CoveredPart* part) {
  part->area_mm2 += area_mm2;
  if (distance_mm <= tolerance_mm) part->covered_mm2 += area_mm2;
  if (distance_mm <= part->largest_mm) return;
  part->largest_mm = distance_mm;
  part->farthest = place;
}

// What is measured of each triangle of the CT's skin.
struct MeasuredSkin {
  const HuGrid& hu;
  const TriangleMesh& skin;
  const TriangleSizes& sizes;
  const std::vector<SkinRegion>& names;
  const std::vector<double>& distance_mm;
};

// The densest HU up to kBehindMm behind the middle of a triangle of the skin, whose surface faces
// outwards.
double HuBehind(const MeasuredSkin& measured, size_t f) {
  const auto row = static_cast<Eigen::Index>(f);
  const auto corner = [&](int k) -> Eigen::Vector3d {
    return measured.skin.positions().row(measured.skin.triangles()(row, k));
  };
  const Eigen::Vector3d out = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
  const Eigen::Vector3d middle = measured.sizes.middles.row(row);
  double densest = Interpolate(measured.hu, middle);
  for (int step = 1; step <= kBehindSteps; ++step) {
    const double deep_mm = kBehindMm * step / kBehindSteps;
    densest = std::max(densest, Interpolate(measured.hu, middle - deep_mm * out));
  }
  return densest;
}

// The mean of what lies behind the uncovered triangles of a region; of all without one.
double HuBehindMissing(const MeasuredSkin& measured, double tolerance_mm,
                       std::optional<SkinRegion> region) {
  double sum = 0;
  double area_mm2 = 0;
  for (size_t f = 0; f < measured.distance_mm.size(); ++f) {
    if (measured.distance_mm[f] <= tolerance_mm || (region && measured.names[f] != *region))
      continue;
    sum += measured.sizes.areas_mm2[f] * HuBehind(measured, f);
    area_mm2 += measured.sizes.areas_mm2[f];
  }
  return area_mm2 > 0 ? sum / area_mm2 : 0;
}

// The connected parts that are farther than the limit, by falling area.
std::vector<SkinGap> PartsBeyond(double limit_mm, const MeasuredSkin& measured) {
  std::vector<bool> is_far;
  std::vector<size_t> triangles;  // of the parts in the order of the skin
  for (size_t f = 0; f < measured.distance_mm.size(); ++f) {
    is_far.push_back(measured.distance_mm[f] > limit_mm);
    if (is_far.back()) triangles.push_back(f);
  }
  if (triangles.empty()) return {};
  const SurfaceParts parts = FindSurfaceParts(KeepTriangles(measured.skin, is_far));
  std::vector<SkinGap> gaps(parts.volumes_mm3.size());
  for (size_t k = 0; k < triangles.size(); ++k) {
    const size_t f = triangles[k];
    SkinGap& gap = gaps[static_cast<size_t>(parts.part_of_triangle[k])];
    gap.area_mm2 += measured.sizes.areas_mm2[f];
    gap.hu_behind += measured.sizes.areas_mm2[f] * HuBehind(measured, f);
    if (measured.distance_mm[f] <= gap.largest_mm) continue;
    gap.largest_mm = measured.distance_mm[f];
    gap.region = measured.names[f];
    gap.farthest = measured.sizes.middles.row(static_cast<Eigen::Index>(f));
  }
  for (SkinGap& gap : gaps) gap.hu_behind /= gap.area_mm2;
  std::stable_sort(gaps.begin(), gaps.end(),
                   [](const SkinGap& a, const SkinGap& b) { return a.area_mm2 > b.area_mm2; });
  return gaps;
}

// Of the mesh's boundary where the CT has its skin.
void CountBone(const MeshedSkin& mesh, const TriangleMesh& skin, int threads,
               SkinCoverage* coverage) {
  const TriangleSizes sizes = SizesOf(mesh.surface);
  const Eigen::VectorXd to_skin = DistancesToSurface(sizes.middles, skin, threads);
  const std::vector<Plane> planes = mesh.region.planes();
  for (Eigen::Index f = 0; f < mesh.surface.num_triangles(); ++f) {
    const bool is_cut = LeastHeightMm(planes, sizes.middles.row(f)) < coverage->tolerance_mm;
    if (is_cut || to_skin[f] > coverage->tolerance_mm) continue;
    const double area_mm2 = sizes.areas_mm2[static_cast<size_t>(f)];
    coverage->mesh_skin_mm2 += area_mm2;
    const auto triangle = mesh.surface.triangles().row(f);
    const auto held = std::count_if(triangle.begin(), triangle.end(), [&](int32_t v) {
      return mesh.regions.bone[v] != 0 || mesh.regions.anatomy[v] != 0;
    });
    if (held >= 2) coverage->mesh_skin_on_bone_mm2 += area_mm2;
  }
}

}  // namespace

absl::StatusOr<SkinCoverage> MeasureSkinCoverage(const HeadSegmentation& head,
                                                 const Landmarks& landmarks, const MeshedSkin& mesh,
                                                 double ct_voxel_mm, int threads) {
  const double tolerance_mm = std::max(kLeastToleranceMm, ct_voxel_mm);
  TF_ASSIGN_OR_RETURN(
      const OuterSkin outer,
      FindOuterSkin(head, mesh.outside_air != nullptr ? *mesh.outside_air : OutsideAir(head),
                    landmarks, mesh.region, tolerance_mm));
  const TriangleMesh& skin = outer.skin;
  TF_ASSIGN_OR_RETURN(const TriangleMesh mesh_skin, SkinOf(mesh));
  const TriangleSizes sizes = SizesOf(skin);
  const Eigen::VectorXd distances = DistancesToSurface(sizes.middles, mesh_skin, threads);
  const std::vector<SkinRegion> names = NameSkinRegions(sizes.middles, landmarks, mesh.mouth);

  SkinCoverage coverage;
  coverage.tolerance_mm = tolerance_mm;
  for (size_t f = 0; f < names.size(); ++f) {
    const auto row = static_cast<Eigen::Index>(f);
    for (CoveredPart* part : {&coverage.whole, &coverage.regions[static_cast<size_t>(names[f])]}) {
      Count(sizes.areas_mm2[f], distances[row], coverage.tolerance_mm, sizes.middles.row(row),
            part);
    }
  }
  coverage.distance_mm.assign(distances.begin(), distances.end());
  const MeasuredSkin measured{head.hu, skin, sizes, names, coverage.distance_mm};
  coverage.whole.hu_behind_missing = HuBehindMissing(measured, tolerance_mm, std::nullopt);
  for (size_t r = 0; r < coverage.regions.size(); ++r) {
    coverage.regions[r].hu_behind_missing =
        HuBehindMissing(measured, tolerance_mm, static_cast<SkinRegion>(r));
  }
  coverage.gaps = PartsBeyond(kGapMm, measured);
  coverage.holes = PartsBeyond(coverage.hole_mm, measured);
  coverage.cuts = MeasureCuts(head.cut, head.head, mesh.region.planes(), landmarks);
  if (outer.cut) {
    coverage.cut_positions = outer.cut->positions();
    coverage.cut_triangles = outer.cut->triangles();
  }
  CountBone(mesh, skin, threads, &coverage);
  coverage.positions = skin.positions();
  coverage.triangles = skin.triangles();
  return coverage;
}

}  // namespace tissueform
