// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/imaging/ct/ct_volume.h"
#include "core/planning/outcome/head_registration.h"

namespace tissueform::testing {

// How an operated head is scanned.
struct CtSimulation {
  double voxel_mm = 1;
  double noise_hu = 15;  // standard deviation
  // Where steel plates lie on the bone, LPS of the scan: each 24 mm long, with two screws. Their
  // slices are what a scanner makes of them, with streaks.
  std::vector<Eigen::Vector3d> plates_mm;
  uint32_t seed = 1;
};

// A CT of these surfaces, which must face outward: air, soft tissue and bone with edges one voxel
// wide, at the surface the segmentation's threshold. The threshold of bone is far from the middle
// between tissue and bone, so bone that is found by it stands out by a third of a voxel: no other
// head is cut where this one was.
CtVolume ScanOf(const PostOperativeHead& head, const CtSimulation& simulation, int threads);

}  // namespace tissueform::testing
