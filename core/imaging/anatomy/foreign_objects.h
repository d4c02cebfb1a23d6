// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// An object that touches the head in a CT and was separated from it.
enum class ObjectKind {
  kTube,     // long, no thicker than a finger, with a wall denser than tissue
  kCord,     // a string: long and thin
  kUnknown,  // larger than an ear; it may be a head rest, but hold a part of the face as well
};

// One piece. The skin under it cannot be seen.
struct AttachedObject {
  ObjectKind kind = ObjectKind::kUnknown;
  double volume_mm3 = 0;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
  // Where it lay on what is left: centres of the head's voxels, each as often as it has faces on
  // the object. LPS, mm.
  std::vector<Eigen::Vector3d> contact_mm;
  double face_mm2 = 0;  // area of a face
};

// What the search works on, all on one grid.
struct ThinPieces {
  const HuGrid& hu;
  const LabelGrid& tissue;
  // Distance from the head's thick part, eroded, and the radius of that erosion. What lies farther
  // from it than this, or hardly so, is thin: noses, ears, lids, and what is no head.
  const FloatGrid& to_core;
  double radius_mm = 0;
  const LabelGrid& thick;  // what of the tissue lies near the core
  const LabelGrid&
      outside;  // air that a ball from outside reaches, which a nostril does not let in
  // How far outside the head with its hollow parts a voxel lies, mm; not positive in it. A tube on
  // the skin stands out of it.
  const FloatGrid& beyond_hull;
};

struct CleanedHead {
  LabelGrid head;  // one component
  std::vector<AttachedObject> objects;
};

// The thick part with the thin pieces that hang on it, but without objects. A thin piece is head
// unless it is
//   a tube: most of it stands out of the hull, it is at least 40 mm long, and either its mean
//     section is under 60 mm2 and within 6 mm of 40 % of it is something denser than tissue but
//     bone, or the section is under 45 mm2 and it leaves the CT by the first or the last slice. A
//     nose, lips and teeth lie within the hull, and an ear is thicker and has nothing dense;
//   a cord: most of it stands out of the hull, it is at least 60 mm long, and its mean section is
//     under 30 mm2. An ear has more than twice that, and a finger is not thin;
//   larger than two ears (20 cm3, or 120 mm long).
// A cord that lies on the skin all along is thin nowhere, but a ridge on the thick part: what
// stands out of the core's distance and of the hull, 60 mm long or more, with a section under 12
// mm2 (an ear's rim has 15 to 18), and denser than skin here and there. Lashes and hair are not.
// What touches nothing is left out without a word. Where a tube lay, the head ends at the core's
// distance, without the rest of the wall that a voxel's blur had joined to the skin.
CleanedHead PartObjects(const ThinPieces& pieces);

}  // namespace tissueform
