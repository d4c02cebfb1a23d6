// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/stiffness_table.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

struct TetStiffnessOptions {
  StiffnessTable table = DefaultStiffnessTable();
  double air_below_hu = -400;  // between fat (-190 and more) and air (-1000)
  // On the CT's grid: 1 + place in the table where the tissue is known otherwise, 0 elsewhere. Null
  // or without voxels: nowhere. The voxel of a tet's barycentre decides.
  const LabelGrid* known_tissue = nullptr;
};

// One entry a tet, and how many tets got their CT number in which way.
struct TetStiffness {
  std::vector<double> mean_hu;
  std::vector<int32_t> voxels;  // how many are in the mean; 0 where none was
  std::vector<int32_t> tissue;  // place in the table
  std::vector<double> youngs_modulus_pa;

  int64_t from_voxels = 0;
  int64_t from_barycentre = 0;
  int64_t from_surroundings = 0;
  int64_t from_mixed_voxels = 0;
  int64_t from_known_tissue = 0;  // of all of these: with a tissue that the CT did not decide
};

// Stiffness of each tet from the CT numbers in it: the mean over the voxels whose centres lie in it
// (Taddei et al. 2004), looked up in the table.
//
// Voxels at an edge hold a bit of bone or air and would make the tissue there look stiff or soft.
// So a voxel is mixed when it or one of its 26 neighbours is bone (nonzero in `bone`) or air (under
// air_below_hu), and a tet takes, of these, the first that there is:
//   1. the mean of its voxels that are not mixed;
//   2. the interpolated value at its barycentre, of those of the eight voxels about it that are not
//      mixed;
//   3. the mean of the voxels that are not mixed in a cube about its barycentre, of 3, 5 or 7
//   voxels;
//   4. the mean of its mixed voxels, or, without any voxel, the interpolated value at its
//   barycentre; but no less than air_below_hu, as air that skin was thickened into is tissue.
//
// REQUIRES: values of known_tissue are in the table.
// Errors: InvalidArgument when the grids differ, when the table is wrong (CheckStiffnessTable), or
// when a tet's barycentre lies outside the grid.
absl::StatusOr<TetStiffness> ComputeTetStiffness(const TetMesh& mesh, const HuGrid& hu,
                                                 const LabelGrid& bone,
                                                 const TetStiffnessOptions& options = {});

}  // namespace tissueform
