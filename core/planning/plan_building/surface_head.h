// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/tet_stiffness.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// A bone that moves as a whole, given as a surface.
struct SegmentSurface {
  std::string name;
  TriangleMesh mesh;
  bool of_lower_jaw = true;
};

// The surfaces of a head, LPS, in mm. Triangles face outward, walls of cavities inward.
struct HeadSurfaces {
  TriangleMesh skin;  // may be open where the head was cut off
  TriangleMesh skull;
  TriangleMesh lower_jaw;
  std::vector<SegmentSurface> segments;  // all segments of the plan in their order, or none
  // Soft tissue with a stiffness of its own: the n-th surface from 0 is class n + 1 of the recipe's
  // tissues, and class 0 what is in none. Later
  // ones come first where they overlap.
  std::vector<TriangleMesh> tissues;
};

// A head as a CT would show it whose anatomy is known: from here on a plan is built as from a CT.
struct SurfaceHead {
  // Voxels as of a CT: air -1000 HU, soft tissue 0, bone 500 and more, linear across borders so
  // that its level sets at the thresholds are the surfaces. The cut is where an opening of the skin
  // was closed.
  HeadSegmentation head;
  BoneParts parts;
  // The class of every voxel, on the head's grid, where tissues have surfaces.
  std::optional<LabelGrid> tissue_class;
  // 0 no bone, 1 bone that stays, 2.. the segments, when these are surfaces.
  std::optional<LabelGrid> segments;
  std::vector<std::string> notes;  // for the report, one sentence each
};

// Every tet gets the class of the voxel at its barycenter; voxels outside the grid are class 0.
//
// REQUIRES: the table has all classes.
TetStiffness StiffnessByClass(const TetMesh& mesh, const LabelGrid& tissue_class,
                              const StiffnessTable& table);

// Makes voxels of surfaces. An opening of the skin wider than 20 mm counts as a cut: an even one is
// closed through its center, one that runs along several faces of the skin's box by these faces.
// Narrower ones are closed as skin.
//
// Errors: InvalidArgument with the reason: a skin of an impossible size (units), a surface that
// faces inward or encloses nothing, bone outside the skin, bones that overlap, a head that does not
// stand upright with the face to the front in LPS.
absl::StatusOr<SurfaceHead> MakeHeadFromSurfaces(const HeadSurfaces& surfaces, double spacing_mm,
                                                 int threads,
                                                 const StageFunction& on_stage = nullptr);

}  // namespace tissueform
