// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/imaging/metal/parallel_beam.h"

namespace tissueform {

// A slice with metal in it, as it is corrected: densities relative to water (1 + HU / 1000, air 0),
// pixels row by row. Projected once; a correction takes a prior and may be made again with a better
// one.
class MetalSlice {
 public:
  // REQUIRES: densities and metal have the beam's number of pixels, and the beam outlives this.
  MetalSlice(const ParallelBeam& beam, std::vector<float> densities, std::vector<uint8_t> metal);

  // The slice with its rays through metal replaced: by the prior's rays, and what the measured ones
  // beside the metal differ from those, linearly between both sides. That is the normalised metal
  // artefact reduction of Meyer et al. (2010, doi 10.1118/1.3484090), with the difference in place
  // of their quotient: along a row of brackets a small error of the prior at one end would become
  // the same part of the whole arch.
  //
  // Only the change of the rays is projected back, and added to the slice: what metal has not
  // touched keeps its resolution and noise. Pixels of metal have no meaning in the result.
  std::vector<float> Corrected(const std::vector<float>& prior) const;

  const std::vector<uint8_t>& metal() const { return metal_; }

 private:
  const ParallelBeam& beam_;
  std::vector<float> densities_;
  std::vector<uint8_t> metal_;
  std::vector<uint8_t> trace_;   // rays that meet metal
  std::vector<uint8_t> wanted_;  // and those beside
  Sinogram measured_;
};

// What a slice would be without metal and streaks, as far as it shows: air, tissue of one density,
// and bone and teeth as they are, of the slice smoothed by a Gaussian of that deviation. Densities
// between those classes stay between them, so that the rays along an edge are those of the slice.
//
// `interpolated` is the slice corrected with a prior of nothing: without streaks, but also without
// anything that metal shades from all sides. What it shows as tissue is not air, nor bone of up to
// 500 HU: so dark is a shadow between two fillings, and so bright a streak. Denser bone, teeth,
// stays.
std::vector<float> MakePrior(const std::vector<float>& densities,
                             const std::vector<float>& interpolated, const SliceShape& shape,
                             double smooth_mm);

}  // namespace tissueform
