// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tissueform {

// A slice of a CT as it is projected: pixels row by row, its middle on the axis of rotation.
struct SliceShape {
  int width = 0;  // pixels
  int height = 0;
  double pixel_width_mm = 1;
  double pixel_height_mm = 1;

  size_t num_pixels() const { return static_cast<size_t>(width) * static_cast<size_t>(height); }
};

// Line integrals of a slice, one row an angle.
struct Sinogram {
  int angles = 0;
  int bins = 0;
  std::vector<float> values;

  size_t Row(int angle) const { return static_cast<size_t>(angle) * static_cast<size_t>(bins); }
};

// Projects slices along parallel rays over half a turn, and back. Debian keeps no library for this
// (its ITK is built without RTK; ctsim is a program without headers).
//
// Const members may be called by several threads at once.
class ParallelBeam {
 public:
  // Bins as wide as the smaller side of a pixel, over the slice's diagonal and a margin; as many
  // angles as keep two neighbouring views less than a pixel apart within the slice.
  explicit ParallelBeam(const SliceShape& slice);

  int angles() const { return angles_; }
  int bins() const { return bins_; }
  double bin_mm() const { return bin_mm_; }

  // 1 for every ray that meets a pixel which is not 0, or passes within half a bin of one.
  std::vector<uint8_t> Shadow(const std::vector<uint8_t>& pixels) const;

  // Integrals of the image, linear between pixel centres (Joseph 1982), along the rays where
  // `wanted` is not 0, in units of the image times mm; 0 along the others.
  // REQUIRES: image.size() == num_pixels(), wanted.size() == angles() * bins().
  Sinogram Project(const std::vector<float>& image, const std::vector<uint8_t>& wanted) const;

  // Adds to the image the filtered back-projection (ramp of Ramachandran and Lakshminarayanan, to
  // the bins' limit) of a sinogram.
  void AddBackProjection(const Sinogram& sinogram, std::vector<float>* image) const;

 private:
  std::vector<float> Filter(const Sinogram& sinogram) const;

  SliceShape slice_;
  double bin_mm_ = 1;
  int bins_ = 0;
  int angles_ = 0;
  std::vector<double> cosine_;
  std::vector<double> sine_;
};

}  // namespace tissueform
