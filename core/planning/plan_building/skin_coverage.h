// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/scanner_cut.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/triangle_mesh.h"
#include "core/planning/plan_building/planning_regions.h"

namespace tissueform {

// How much of the CT's outer skin (core/imaging/anatomy/outer_skin.h) the mesh has: measured from
// the CT to the mesh, so that what is missing cannot be overlooked. Lengths in mm, areas in mm2,
// LPS.

// The requirements. A gap is a connected part of the CT's skin that is farther from the mesh's skin
// than kGapMm. A hole is one that is farther than the tolerance and than kHoleMm: were only shares
// and gaps counted, a piece of 10 mm could be missing from a cheek of 50 cm2.
inline constexpr double kLeastToleranceMm = 1.5;  // one voxel of the CT where that is larger
inline constexpr double kLeastCovered = 0.99;     // of every region's area
inline constexpr double kGapMm = 4;
inline constexpr double kLargestGapMm2 = 50;
inline constexpr double kHoleMm = 2.5;
inline constexpr double kLargestHoleMm2 = 10;

// Of one region of the skin, or of all.
struct CoveredPart {
  double area_mm2 = 0;
  double covered_mm2 = 0;  // nearer to the mesh's skin than the tolerance
  double largest_mm = 0;
  Eigen::Vector3d farthest = Eigen::Vector3d::Zero();  // where that is
  double hu_behind_missing = 0;  // as SkinGap::hu_behind, of what is not covered

  double share() const { return area_mm2 > 0 ? covered_mm2 / area_mm2 : 1; }
};

// A connected part that is farther than a limit.
struct SkinGap {
  SkinRegion region = SkinRegion::kNone;  // of its farthest place
  double area_mm2 = 0;
  double largest_mm = 0;
  Eigen::Vector3d farthest = Eigen::Vector3d::Zero();
  // The densest that the CT shows up to 3 mm behind it, on average: fat has -100 HU, muscle 50, and
  // so has the thin wall of a nose. Hair and cloth that the threshold takes for skin have less.
  double hu_behind = 0;
};

struct SkinCoverage {
  double tolerance_mm = 0;
  CoveredPart whole;
  // By number of SkinRegion; kNone is the rest.
  std::vector<CoveredPart> regions = std::vector<CoveredPart>(kNamedSkinRegions.size() + 1);
  std::vector<SkinGap> gaps;   // by falling area
  std::vector<SkinGap> holes;  // by falling area
  double hole_mm = kHoleMm;    // that they are farther than

  // Where the scanner's circle or a side of the CT cuts what is modelled. It is no skin of the CT,
  // and nothing is measured there or within the tolerance beside it.
  std::vector<ScannerCut> cuts;

  // Of the mesh's boundary where the CT has its skin: what lies on bone or is held by it.
  double mesh_skin_mm2 = 0;
  double mesh_skin_on_bone_mm2 = 0;

  // The CT's outer skin in the region of interest, #F triangles, and how far the middle of each
  // lies from the mesh's skin; for pictures.
  std::vector<double> distance_mm;
  Positions positions;
  TriangleIndices triangles;
  // What would be skin there if it were not at a cut, #G triangles; for pictures.
  Positions cut_positions;
  TriangleIndices cut_triangles;
};

// What a plan's mesh is and where it lies.
struct MeshedSkin {
  const TriangleMesh& surface;
  const PlanningRegions& regions;
  const RegionOfInterest& region;
  const LabelGrid* outside_air = nullptr;  // OutsideAir(head); null: it is found here
  const MouthLine* mouth = nullptr;        // as in PlanningCt
};

// Within a voxel of the planes of the region of interest, and of HeadSegmentation::cut, nothing is
// counted. `ct_voxel_mm` is the longest side of a voxel of the CT as it was read. The result does
// not depend on `threads`.
//
// Errors: those of ExtractSurface; InvalidArgument when no outer skin lies in the region.
absl::StatusOr<SkinCoverage> MeasureSkinCoverage(const HeadSegmentation& head,
                                                 const Landmarks& landmarks, const MeshedSkin& mesh,
                                                 double ct_voxel_mm, int threads = 1);

}  // namespace tissueform
