// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

// A CT scanner for tests: what metal does to slices is made by the physics that makes it in a
// hospital, so that a correction is tried on something it does not know. It shares no code with
// core/imaging/metal, and no geometry: a fan beam here, supersampled metal, a spectrum.
namespace tissueform::testing {

enum class Metal { kAmalgam, kSteel };

// Mass attenuation times density, 1/mm, of one bin of the beam's spectrum.
struct SpectrumBin {
  double energy_kev = 0;
  double weight = 0;  // of the detected intensity without a patient; all add up to 1
  double water = 0;
  double bone = 0;  // cortical
  double amalgam = 0;
  double steel = 0;

  double Of(Metal metal) const { return metal == Metal::kSteel ? steel : amalgam; }
};

const std::vector<SpectrumBin>& Spectrum();

// A square slice as a mixture of two substances, x fastest: parts of water's density and of
// cortical bone's. The scanner's axis runs through its centre.
struct TissueSlice {
  int size = 0;
  double pixel_mm = 1;
  std::vector<Eigen::Array2f> density;  // (water, bone)
};

// Under 100 HU all is water of some density, over 1500 all is bone, between the two a mixture.
TissueSlice TissueOfHu(const int16_t* hu, int size, double pixel_mm);

// A small piece of metal, from the scanner's axis along the slice's rows and columns.
struct MetalCell {
  float x_mm = 0;
  float y_mm = 0;
  float area_mm2 = 0;  // what is metal of it
};

// Equal layers of one slice, each with its cells: a thin wire crosses a part of the slice's
// thickness only, and it is the photons that are averaged over the thickness, not the lengths.
using MetalLayers = std::vector<std::vector<MetalCell>>;

struct ScannerOptions {
  double source_mm = 570;  // from the source to the axis
  int num_views = 984;     // over the full turn
  int num_channels = 512;
  double channel_mm = 0.55;        // on the flat detector, scaled to the axis
  double photons = 3e5;            // a channel and view, without a patient
  double electronic_photons = 12;  // standard deviation of the electronics' noise
  double least_photons = 4;        // what the logarithm sees where nothing arrives
};

// Lengths in mm along rays, channels by views.
struct TissueLengths {
  Eigen::ArrayXXf water;
  Eigen::ArrayXXf bone;
};

// Thread-safe after construction; equal input, equal bytes.
class CtScanner {
 public:
  explicit CtScanner(const ScannerOptions& options = {});

  TissueLengths ProjectTissue(const TissueSlice& slice) const;

  // Lengths of metal in mm along every ray, of one layer.
  Eigen::ArrayXXf ProjectMetal(const std::vector<MetalCell>& cells) const;

  // Of every ray: the share of the photons that arrives.
  Eigen::ArrayXXf Transmission(const TissueLengths& tissue) const;

  // The same with metal in the place of the tissue of `slice`. `free` is Transmission's.
  Eigen::ArrayXXf WithMetal(const Eigen::ArrayXXf& free, const TissueSlice& slice,
                            const TissueLengths& tissue, Metal metal,
                            const MetalLayers& layers) const;

  // What the scanner takes for the length of water along every ray: counted photons with Poisson's
  // and electronic noise, their logarithm, the correction of water's beam hardening. The noise
  // depends on the seed and the photons only, so rays that meet no metal are the same with it and
  // without.
  Eigen::ArrayXXf Measure(Eigen::ArrayXXf transmission, uint32_t seed) const;

  // Filtered back-projection, in HU: water 0, air -1000, cut off to [-1024, 3071].
  std::vector<int16_t> Reconstruct(const Eigen::ArrayXXf& lengths, int size, double pixel_mm) const;

 private:
  Eigen::ArrayXXf Splat(const std::vector<MetalCell>& cells,
                        const std::vector<float>& factor) const;
  double WaterLength(double attenuation) const;
  double ChannelAt(double u_mm) const { return u_mm / options_.channel_mm + centre_; }

  ScannerOptions options_;
  double centre_ = 0;                       // the channel of the central ray
  std::vector<Eigen::Vector2d> to_source_;  // unit vectors, by view
  Eigen::MatrixXf filter_;                  // channels by channels
  std::vector<double> water_attenuation_;   // of water 0, 1, 2 .. mm long
};

}  // namespace tissueform::testing
