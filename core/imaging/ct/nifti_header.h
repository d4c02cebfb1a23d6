// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include <Eigen/Core>

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Where NIfTI-1 places its voxels, as the header states it: in its unit, RAS. ITK
// refuses axes that are off square by rounding, takes the unit for the spacing only, and does not
// compare the two forms.
struct NiftiHeader {
  using Form = Eigen::Matrix<double, 3, 4>;  // steps along i, j, k; then the place of voxel 0

  std::optional<Form> qform;  // where its code is positive
  std::optional<Form> sform;
  int unit = 0;  // xyzt_units: 1 m, 2 mm, 3 micrometers, 0 not stated
  double voxel_offset = 0;
  int voxel_bits = 0;

  bool StatesPlace() const { return qform || sform; }
  // A unit that is not the millimeter.
  bool NeedsScale() const { return unit == 1 || unit == 3; }
};

// ITK 5.2 reads no NIfTI-2, whose header is longer.
inline constexpr size_t kNiftiHeaderBytes = 348;

// From the head of an unpacked file, in either byte order; none where it is not NIfTI-1.
std::optional<NiftiHeader> ParseNiftiHeader(absl::string_view start);

// Errors: InvalidArgument when the forms mirror each other: one has the patient's left where the
// other has the right.
absl::Status CheckForms(const NiftiHeader& header);

// Sets spacing, direction, origin and tilt of `volume` in mm and LPS, from the sform if there is
// one, with a note where the unit is converted or axes are made square (off by up to 1e-2). Slices
// that are sheared along their columns are as those of a tilted gantry. REQUIRES: StatesPlace().
//
// Errors: InvalidArgument where steps are no finite volume, for rows and columns that are not
// square to each other, and for slices sheared otherwise or by more than a gantry tilts.
absl::Status PlaceByHeader(const NiftiHeader& header, CtVolume* volume);

}  // namespace tissueform
