// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/foreign_objects.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

struct HeadSegmentationOptions {
  // Half-way between air (-1000) and skin (about 0): where a scanner's blur leaves the surface.
  int16_t tissue_above_hu = -500;
  int16_t bone_above_hu = 250;
  // What is thicker than twice this and hangs together is head; of what is thinner, what hangs on
  // it and is no object (core/imaging/anatomy/foreign_objects.h).
  double opening_radius_mm = 4;
  double smallest_bone_mm3 = 150;
};

// What is head and what of it is bone. All grids have one geometry: the CT's voxels round the head.
struct HeadSegmentation {
  // The CT with everything that is not head (tubes, cords, head rest) replaced by air: its surface
  // at `tissue_above_hu` is that of the head and of its cavities.
  HuGrid hu;
  LabelGrid head;  // tissue and bone, without airway, sinuses and the open mouth
  LabelGrid bone;  // subset of the head
  // 1 for fillings, brackets and wires, which are bone as well: they belong to the teeth they sit
  // on. All 0 where there is no metal.
  LabelGrid metal;
  // The head's voxels (1) that end where the CT does, not where the head does
  // (core/imaging/anatomy/scanner_cut.h); without voxels where the CT does not cut the head.
  LabelGrid cut;
  HeadSegmentationOptions options;

  double streaks_mm3 = 0;  // dense as bone, but taken for what metal's streaks have left
  double removed_mm3 = 0;  // removed objects: tubes, cords, head rest
  std::vector<AttachedObject> objects;  // of it what touched the head, by falling volume
  double bare_fraction =
      0;  // of the outer surface: nearer than 2.5 mm to bone; a living head 0..0.1
};

// Finds the largest body of tissue with its connected thin parts (ears, the walls of a nose),
// without objects that touch it, and its bone.
//
// `metal`, and `unscanned` (core/imaging/ct/unscanned.h), are masks on the CT's grid; each is
// without voxels when there is nothing to mask.
//
// Errors: InvalidArgument when there is too little tissue or bone for a head, or when no soft
// tissue covers the bone (a skull, a phantom).
absl::StatusOr<HeadSegmentation> SegmentHead(const HuGrid& ct,
                                             const HeadSegmentationOptions& options = {},
                                             const StageFunction& on_stage = nullptr,
                                             const LabelGrid& metal = {},
                                             const LabelGrid& unscanned = {});

}  // namespace tissueform
