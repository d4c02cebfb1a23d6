// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/triangle_mesh.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// How many triangles there are, for drawing.
inline constexpr int64_t kSkinTriangles = 70'000;
inline constexpr int64_t kBoneTriangles = 80'000;  // all bone and teeth together

// What a build has found out; all grids have one geometry.
struct ViewerSources {
  const HeadSegmentation& head;
  const LabelGrid& outside_air;  // OutsideAir(head)
  const LabelGrid& parts;        // BoneParts::labels
  const LabelGrid& bone;         // kFixedBone, and from kFirstSegment on the segments
  const Landmarks& landmarks;
  std::vector<std::string> segments;  // their names
  double ct_voxel_mm = 1;             // longest side of a voxel of the CT as it was read
};

// What a planner looks at, from the CT itself: the outer skin of the whole head, bone that stays,
// the segments as they are cut, and the teeth of each apart, so that they may be coloured. Where
// the CT ends and the head does not is apart from its skin, too. Surfaces have no follows.
//
// The first is the skin. Errors: those of ExtractSurface and DecimateSurface; InvalidArgument when
// there is no skin.
absl::StatusOr<std::vector<CaseSurface>> MakeViewerSurfaces(const ViewerSources& sources);

// Skin and bone of a head whose jaws are not separated: all that a scan shows, whether it hangs
// together or not. The skin is open
// where the CT ends.
struct HeadShells {
  TriangleMesh skin;
  TriangleMesh bone;
};

// Of the segmented head, with as many triangles as above. Errors: those of MakeViewerSurfaces.
absl::StatusOr<HeadShells> MakeHeadShells(const HeadSegmentation& head, double ct_voxel_mm);

}  // namespace tissueform
