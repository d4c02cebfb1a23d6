// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/base/types.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/lip_seam.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/mechanics/constraints/contact_row.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/planning/plan_building/planning_regions.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/soft_tissue_mesh.h"

namespace tissueform {

// The line of the recipe, or else the one that the CT shows.
//
// Errors: InvalidArgument when the recipe's line does not run from right to left or is wider than a
// mouth, or when the CT shows none.
absl::StatusOr<MouthLine> ChooseMouthLine(const RecipeLips& lips, const HeadSegmentation& head,
                                          const Landmarks& landmarks);

// What a mesh has got on the seam before it is parted.
struct SeamInMesh {
  LipSeam seam;
  std::vector<int8_t> side;  // #V: SeamedMesh::side
  int64_t num_moved = 0;
  int64_t num_added = 0;
};

// Gives the mesh facets in the seam; the boundary's vertices come first as before. Of the report
// what concerns the tets is measured again.
absl::StatusOr<SeamInMesh> PutSeamInMesh(LipSeam seam, SoftTissueMesh* made);

// Bits of the mesh's point array "contact".
inline constexpr uint8_t kSlides = 1;     // a bilateral row
inline constexpr uint8_t kMeetsBone = 2;  // a unilateral row of bone
inline constexpr uint8_t kMeetsOtherLip = 4;

// Lips that are parted, and what their tissue touches.
struct PartedLips {
  MouthLine line;
  double vestibule_mm = 0;
  int64_t num_moved = 0;  // see SeamedMesh
  int64_t num_added = 0;
  std::vector<int32_t> original_of_double;  // see PartedMesh
  TriangleIndices wall;
  std::vector<ContactRow> rows;  // handles are those of the segments, in their order
  LipEdge edge;                  // without pairs of lips that are apart in the CT
  std::vector<uint8_t> contact;  // #V, of the bits above
};

struct VestibuleAnatomy {
  const LabelGrid& parts;        // BoneParts::labels
  const LabelGrid& soft_tissue;  // SoftTissue::labels
  Eigen::Vector3d up;            // of the head frame
  double vestibule_mm = 10;
};

// Parts the mesh and appends the doubles to the regions: they are what their originals are, those
// on the skin of the lower lip.
//
// Rows: within `vestibule_mm` of the seam and of the corners, on the side of the jaws that faces
// the lips,
//  * tissue on bone of its own jaw slides along it (bilateral);
//  * tissue on bone of the other jaw may lift off it (unilateral);
//  * tissue with up to 5 mm of air before a jaw may meet it (unilateral, with that gap);
//  * a vertex of the seam and its double may lift off each other (unilateral).
// Bone behind the teeth holds what it held: its vertices on the seam stay one.
// The lips' edge is what of the seam lies on the skin at the mouth line (LipSeam::ClosesAt); it is
// empty where the lips do not touch along 10 mm or more.
// Normals of bone are those of its dental arch, laid into the plane square to `up`: with normals
// turned up at the incisors' edges tissue slips off them.
absl::StatusOr<PartedLips> PartLips(const SeamInMesh& seam, const VestibuleAnatomy& anatomy,
                                    SoftTissueMesh* made, PlanningRegions* regions);

}  // namespace tissueform
