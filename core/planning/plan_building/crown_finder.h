// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

enum BonePart : size_t { kPlainBone = 0, kUpperTeeth = 1, kLowerTeeth = 2 };

// What of a surface of bone are crowns of teeth, by where it lies: a slab below the plane through
// the tips of the teeth, as wide as an arch and as long as from the incisors to the last tooth.
// Good for colours; its border is no gum line.
class CrownFinder {
 public:
  // Of the surface of `bone` with that label; `parts` are BoneParts::labels. All must outlive it.
  CrownFinder(const Landmarks& landmarks, const LabelGrid& parts, const LabelGrid& bone,
              uint8_t label)
      : landmarks_(landmarks), parts_(parts), bone_(bone), label_(label) {}

  // Of a place on that surface.
  BonePart operator()(const Eigen::Vector3d& place) const;

  // The surface with edges where crowns begin, so that every triangle is of one part.
  TriangleMesh Cut(const TriangleMesh& surface) const;

 private:
  // How far inside the room of the crowns, in mm; negative outside.
  double UpperHeight(const Eigen::Vector3d& place) const;
  double LowerHeight(const Eigen::Vector3d& place) const;
  // `tips_up` is 1 for lower teeth, -1 for upper ones.
  double CrownHeight(const Eigen::Vector3d& place, const Plane& teeth,
                     const Eigen::Vector3d& incisor, double tips_up) const;
  // Of the label's voxels about the place, which lies on their border.
  uint8_t PartAt(const Eigen::Vector3d& place) const;

  const Landmarks& landmarks_;
  const LabelGrid& parts_;
  const LabelGrid& bone_;
  const uint8_t label_;
};

}  // namespace tissueform
