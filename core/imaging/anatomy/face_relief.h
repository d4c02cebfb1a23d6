// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/imaging/anatomy/face_axes.h"
#include "core/imaging/anatomy/head_segmentation.h"

namespace tissueform {

// The front of a face as heights over a regular grid of face coordinates.
struct FaceRelief {
  double right_mm = 0;   // `left` of the first column
  double bottom_mm = 0;  // `up` of the first row
  double column_mm = 1;  // between columns
  double row_mm = 0.5;   // between rows
  // Rows by columns: `front` of the first skin that a ray from the front meets. Minus infinity
  // where it meets none within the relief's depth; NaN where what it meets is no skin, but the end
  // of the CT.
  Eigen::ArrayXXd front_mm;

  double LeftOf(Eigen::Index column) const {
    return right_mm + static_cast<double>(column) * column_mm;
  }
  double UpOf(Eigen::Index row) const { return bottom_mm + static_cast<double>(row) * row_mm; }
};

// What part of a face a relief shows, in face coordinates.
struct ReliefExtent {
  double half_width_mm = 0;
  double bottom_mm = 0;
  double top_mm = 0;
  double foremost_mm = 0;  // where rays begin
  double depth_mm = 0;     // and how far they go
};

// The skin is the CT's isosurface at -300 HU, true to a part of a voxel: a beard or a moustache is
// not skin. It lies some tenths of a millimeter behind the model's skin (-500 HU).
FaceRelief MeasureFaceRelief(const HeadSegmentation& head, const FaceAxes& axes,
                             const ReliefExtent& extent);

}  // namespace tissueform
