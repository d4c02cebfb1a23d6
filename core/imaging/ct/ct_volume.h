// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace tissueform {

// Slices that are farther apart than this leave anatomy unseen that a plan would be built from.
inline constexpr double kFarApartMm = 5;

// A part of a CT in which its slices (or the voxels of another axis) lie far apart: between two
// heights along a direction, p . normal.
struct SliceGap {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of the slices, LPS
  double from_mm = 0;
  double to_mm = 0;
  double largest_mm = 0;  // between neighbours in this part, square to the slices
};

// Where a volume came from, for the report. Holds no patient identifier and no path.
struct CtProvenance {
  std::string format;  // "DICOM", "NIfTI", "NRRD", "MetaImage"
  int num_files = 0;

  // SHA-256 in hexadecimal digits: of the file where it is one, otherwise of the digests of the
  // files one after the other (slices in the order of the volume; a header before its data). Names
  // and order of files in a folder do not matter.
  std::string sha256;

  // Angle from the stacking direction to the slices' normal, turned about the rows' direction; 0
  // where slices are stacked upright. The volume lies sheared, as it was taken.
  double gantry_tilt_deg = 0;

  // What a reader of the report should know, one sentence each.
  std::vector<std::string> notes;

  // Where slices are farther apart than kFarApartMm, neighbouring gaps as one: no plan should rest
  // on what was interpolated there.
  std::vector<SliceGap> wide_gaps;
};

// The field of view of a cone-beam scanner: a cylinder along an axis of the file.
struct CylinderField {
  int axis = 2;
  // Of its axis, along the other two axes of the file, in rising order.
  Eigen::Vector2d center_voxels = Eigen::Vector2d::Zero();
  double radius_mm = 0;
  int16_t outside_value = 0;  // in the file
};

// A CT volume as it was read: nothing resampled, axes as in the file.
struct CtVolume {
  std::array<int, 3> size = {0, 0, 0};                   // voxels along the file's axes i, j, k
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();  // between voxel centres along each
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();   // centre of voxel (0, 0, 0), DICOM LPS

  // Columns: the unit vectors in DICOM LPS along which i, j and k grow. Any handedness; the third
  // is not square to the others where the gantry was tilted.
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();

  // Where slices lie unevenly, or beside the line of the others: the centre of voxel (0, 0, k) of
  // each, rising along direction.col(0) x direction.col(1). Empty where they are even; otherwise
  // spacing_mm[2] is their usual distance.
  std::vector<Eigen::Vector3d> slice_origins_mm;

  std::vector<int16_t> hu;  // i fastest; at least -1024

  // DICOM's frame of reference, to compare with that of a label map; empty for other files. Never
  // in a message or report.
  std::string frame_uid;

  bool has_gray_values = false;        // `hu` holds the file's values, which are not HU
  std::optional<CylinderField> field;  // set by PrepareValues (core/imaging/ct/gray_values.h)

  CtProvenance provenance;

  int64_t num_voxels() const { return int64_t{size[0]} * size[1] * size[2]; }
  int16_t At(int i, int j, int k) const {
    return hu[static_cast<size_t>(i + int64_t{size[0]} * (j + int64_t{size[1]} * k))];
  }
  // Columns: from one voxel to the next, in mm. p = origin_mm + StepsMm() * (i, j, k) where slices
  // are even; along i and j always.
  Eigen::Matrix3d StepsMm() const { return direction * spacing_mm.asDiagonal(); }
  // Where the centre of voxel (i, j, k) lies.
  Eigen::Vector3d Place(int i, int j, int k) const {
    if (slice_origins_mm.empty()) return origin_mm + StepsMm() * Eigen::Vector3d(i, j, k);
    return slice_origins_mm[static_cast<size_t>(k)] + StepsMm() * Eigen::Vector3d(i, j, 0);
  }
};

}  // namespace tissueform
