// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The CT and where tissue begins in it: what the labels leave out is brain or the like, not air,
// where the CT is above.
struct PlanningCt {
  const HuGrid& hu;
  double tissue_above_hu = 0;
  const LabelGrid* cut = nullptr;  // HeadSegmentation::cut; null or without voxels: none
};

// What every vertex of a planning mesh is. Numbers of `anatomy`: 0 free, 1 fixed (bone that stays,
// and the cuts of the region), 2.. the moved segments.
struct PlanningRegions {
  std::vector<uint8_t> anatomy;      // #V
  std::vector<uint8_t> skin_region;  // #V, SkinRegion; 0 also inside and off the skin
  std::vector<bool> on_skin;         // #V: facing air, not a cut of any kind
  std::vector<uint8_t> bone;         // #V: what bone it lies on, in the contact band too, as in
                                     // `anatomy`; 0: none

  int64_t freed_by_contact = 0;  // vertices on bone that were left free
};

// How far the farthest voxel with `label` moves, in mm; 0 when there is none.
double LargestMoveMm(const LabelGrid& labels, uint8_t label, const HandlePose& pose);

// A vertex of the boundary is on a cut where a plane of the region is nearer than 0.6 voxels, and
// on what the nearest voxel outside the soft tissue is: bone that stays, a segment, or air.
//
// Where the scanner's circle cuts the head, a vertex is free, but no skin.
//
// Bone nearer than `contact_band_mm` to bone that moves otherwise (teeth, the walls of a cut, a
// joint) is left free on both sides, so that tissue between them is not torn; and so are the
// vertices of tets that two different constraints would hold all the same. Cuts nearer than three
// times that to a segment are left free, too: they are no anatomy, and would hold the skin.
//
// `boundary_vertices` is the number of vertices of the mesh on its boundary, which come first.
// Errors: InvalidArgument when the band leaves a segment or the fixed bone without vertices.
absl::StatusOr<PlanningRegions> AssignRegions(const TetMesh& mesh, Eigen::Index boundary_vertices,
                                              const SoftTissue& soft_tissue,
                                              const std::vector<std::string>& segments,
                                              double contact_band_mm, const Landmarks& landmarks,
                                              const PlanningCt& ct);

}  // namespace tissueform
