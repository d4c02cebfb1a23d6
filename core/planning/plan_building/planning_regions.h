// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The CT and where tissue begins in it: what the labels leave out is brain or the like, not air,
// where the CT is above.
struct PlanningCt {
  const HuGrid& hu;
  double tissue_above_hu = 0;
  const LabelGrid* cut = nullptr;    // HeadSegmentation::cut; null or without voxels: none
  const MouthLine* mouth = nullptr;  // where the regions of the lips meet; null: NameSkinRegions
};

// Where bone holds no tissue, so that none is torn.
struct FreeBands {
  double contact_mm = 0;  // from bone that moves otherwise (teeth, the walls of a cut, a joint)
  // Of each segment how far from its cut the surgeon lifts tissue off the bone that stays: it is
  // free there, and the piece keeps its tissue up to the cut. 0: the cut is as any other contact.
  std::vector<double> dissected_mm = {};  // #segments, or empty: all 0
  const LabelGrid* parts = nullptr;       // BoneParts::labels, on the grid of the soft tissue's
                                          // labels; not owned; needed where dissected_mm is not 0

  double DissectedMm(uint8_t label) const;  // of the segment of that label; 0 of bone that stays
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

// How far the farthest voxel with `label` moves, in mm; 0 if no voxel has it.
double LargestMoveMm(const LabelGrid& labels, uint8_t label, const HandlePose& pose);

// A vertex of the boundary is on a cut where a plane of the region is nearer than 0.6 voxels, and
// on what the nearest voxel outside the soft tissue is: bone that stays, a segment, or air.
//
// Where the scanner's circle cuts the head, a vertex is free, but is not skin.
//
// Bone is left free as `bands` say, and so are the vertices of tets that two different constraints
// would otherwise still hold. Cuts nearer than three contact bands to a segment are left free, too:
// they are not anatomy, and would hold the skin.
//
// `boundary_vertices` is the number of vertices of the mesh on its boundary, which come first.
// Errors: InvalidArgument when the bands leave a segment or the fixed bone without vertices.
absl::StatusOr<PlanningRegions> AssignRegions(const TetMesh& mesh, Eigen::Index boundary_vertices,
                                              const SoftTissue& soft_tissue,
                                              const std::vector<std::string>& segments,
                                              const FreeBands& bands, const Landmarks& landmarks,
                                              const PlanningCt& ct);

}  // namespace tissueform
