// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/ct_scanner.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

namespace tissueform::testing {
namespace {

constexpr double kPi = std::numbers::pi;

// J. H. Hubbell and S. M. Seltzer, Tables of X-Ray Mass Attenuation Coefficients, NIST Standard
// Reference Database 126: total attenuation in cm2/g of liquid water, cortical bone (ICRU-44),
// silver, iron. The weights are a coarse spectrum of a 120 kV tube behind its filters
// times the energy, as detectors integrate it.
struct TableRow {
  double energy_kev, weight, water, bone, silver, iron;
};
constexpr TableRow kTable[] = {
    {30, 0.02, 0.3756, 1.331, 36.68, 8.176},   {40, 0.10, 0.2683, 0.6655, 17.20, 3.629},
    {50, 0.18, 0.2269, 0.4242, 9.444, 1.958},  {60, 0.28, 0.2059, 0.3148, 5.766, 1.205},
    {80, 0.27, 0.1837, 0.2229, 2.651, 0.5952}, {100, 0.15, 0.1707, 0.1855, 1.470, 0.3717}};

// Densities in g/cm3. Amalgam is silver, tin and mercury, which differ by less than a fifth from
// silver at these energies; it has the density of amalgam and the table of silver.
constexpr double kBoneDensity = 1.92;
constexpr double kAmalgamDensity = 11;
constexpr double kSteelDensity = 7.9;
constexpr double kPerMm = 0.1;  // from 1/cm

// Attenuation of water over that of cortical bone where the beam is after a head, about 70 keV.
constexpr double kWaterOverBone = 0.385;
constexpr double kAllWaterHu = 100;
constexpr double kAllBoneHu = 1500;
constexpr double kAirHu = -950;

constexpr int kLongestWaterMm = 1200;

// The ramp, band-limited at the channels, times a raised cosine: (1/4, 1/2, 1/4) between channels.
// Without it noise and streaks are sharper than those of a scanner's soft kernel.
double SoftRamp(int n, double step_mm) {
  const auto ramp = [step_mm](int k) {
    if (k == 0) return 1 / (4 * step_mm * step_mm);
    return k % 2 == 0 ? 0.0 : -1 / (kPi * kPi * k * k * step_mm * step_mm);
  };
  return 0.25 * ramp(n - 1) + 0.5 * ramp(n) + 0.25 * ramp(n + 1);
}

// The part of the slice that is not air: from first to last along x and y.
struct Extent {
  int first[2] = {0, 0};
  int last[2] = {-1, -1};
};

Extent BodyOf(const TissueSlice& slice) {
  Extent body{{slice.size, slice.size}, {-1, -1}};
  for (int y = 0; y < slice.size; ++y) {
    for (int x = 0; x < slice.size; ++x) {
      if ((slice.density[static_cast<size_t>(y * slice.size + x)] == 0).all()) continue;
      body.first[0] = std::min(body.first[0], x);
      body.last[0] = std::max(body.last[0], x);
      body.first[1] = std::min(body.first[1], y);
      body.last[1] = std::max(body.last[1], y);
    }
  }
  return body;
}

// Joseph's method: the ray is sampled once in every row (or column) of pixels that it crosses most
// steeply, between two neighbours. `source` and `direction` in units of pixels.
Eigen::Array2f SumAlong(const TissueSlice& slice, const Extent& body, const Eigen::Vector2d& source,
                        const Eigen::Vector2d& direction) {
  const int along = std::abs(direction.x()) >= std::abs(direction.y()) ? 0 : 1;
  const int across = 1 - along;
  const int step = along == 0 ? 1 : slice.size;
  const int side = along == 0 ? slice.size : 1;
  const auto slope = static_cast<float>(direction[across] / direction[along]);
  const auto start = static_cast<float>(source[across] - source[along] * slope);
  const auto low = static_cast<float>(std::max(0, body.first[across] - 1));
  const auto high = static_cast<float>(std::min(slice.size - 1, body.last[across] + 1));
  Eigen::Array2f sum(0, 0);
  int first = body.first[along];
  int last = body.last[along];
  if (std::abs(slope) > 1e-6F) {
    const std::pair<float, float> inside =
        std::minmax({(low - start) / slope, (high - start) / slope});
    first = std::max(first, static_cast<int>(std::clamp(inside.first, -1e6F, 1e6F)));
    last = std::min(last, static_cast<int>(std::clamp(inside.second, -1e6F, 1e6F)));
  }
  for (int i = first; i <= last; ++i) {
    const float place = start + slope * static_cast<float>(i);
    if (place < low || place >= high) continue;
    const int lower = static_cast<int>(place);
    const float part = place - static_cast<float>(lower);
    const Eigen::Array2f* cell = &slice.density[static_cast<size_t>(i * step + lower * side)];
    sum += cell[0] + part * (cell[side] - cell[0]);
  }
  return sum * static_cast<float>(direction.norm() / std::abs(direction[along]));
}

Eigen::Array2f DensityAt(const TissueSlice& slice, const MetalCell& cell) {
  const auto pixel = [&](float mm) {
    const double place = mm / slice.pixel_mm + 0.5 * (slice.size - 1);
    return std::clamp(static_cast<int>(std::lround(place)), 0, slice.size - 1);
  };
  return slice.density[static_cast<size_t>(pixel(cell.y_mm) * slice.size + pixel(cell.x_mm))];
}

double Arriving(double water_mm, double bone_mm, double metal_mm, Metal metal) {
  double sum = 0;
  for (const SpectrumBin& bin : Spectrum()) {
    sum += bin.weight *
           std::exp(-bin.water * water_mm - bin.bone * bone_mm - bin.Of(metal) * metal_mm);
  }
  return sum;
}

}  // namespace

const std::vector<SpectrumBin>& Spectrum() {
  static const auto* const bins = [] {
    auto* made = new std::vector<SpectrumBin>;
    for (const TableRow& row : kTable) {
      made->push_back({.energy_kev = row.energy_kev,
                       .weight = row.weight,
                       .water = kPerMm * row.water,
                       .bone = kPerMm * kBoneDensity * row.bone,
                       .amalgam = kPerMm * kAmalgamDensity * row.silver,
                       .steel = kPerMm * kSteelDensity * row.iron});
    }
    return made;
  }();
  return *bins;
}

TissueSlice TissueOfHu(const int16_t* hu, int size, double pixel_mm) {
  TissueSlice slice{.size = size, .pixel_mm = pixel_mm, .density = {}};
  slice.density.reserve(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (int i = 0; i < size * size; ++i) {
    const double value = hu[i];
    const double all = value < kAirHu ? 0 : 1 + value / 1000;
    const double bone =
        std::clamp((value - kAllWaterHu) / (kAllBoneHu - kAllWaterHu), 0.0, 1.0) * all;
    slice.density.emplace_back(static_cast<float>(all - bone),
                               static_cast<float>(bone * kWaterOverBone));
  }
  return slice;
}

CtScanner::CtScanner(const ScannerOptions& options)
    : options_(options),
      centre_(0.5 * (options.num_channels - 1)),
      filter_(options.num_channels, options.num_channels) {
  for (int view = 0; view < options.num_views; ++view) {
    const double angle = 2 * kPi * view / options.num_views;
    to_source_.emplace_back(std::cos(angle), std::sin(angle));
  }
  // Half of it, because a full turn sees every line twice.
  for (int row = 0; row < options.num_channels; ++row) {
    for (int column = 0; column < options.num_channels; ++column) {
      filter_(row, column) =
          static_cast<float>(0.5 * options.channel_mm * SoftRamp(row - column, options.channel_mm));
    }
  }
  for (int mm = 0; mm <= kLongestWaterMm; ++mm) {
    double intensity = 0;
    for (const SpectrumBin& bin : Spectrum()) intensity += bin.weight * std::exp(-bin.water * mm);
    water_attenuation_.push_back(-std::log(intensity));
  }
}

TissueLengths CtScanner::ProjectTissue(const TissueSlice& slice) const {
  TissueLengths lengths{Eigen::ArrayXXf(options_.num_channels, options_.num_views),
                        Eigen::ArrayXXf(options_.num_channels, options_.num_views)};
  const Extent body = BodyOf(slice);
  const Eigen::Vector2d middle = Eigen::Vector2d::Constant(0.5 * (slice.size - 1));
  for (int view = 0; view < options_.num_views; ++view) {
    const Eigen::Vector2d& to_source = to_source_[static_cast<size_t>(view)];
    const Eigen::Vector2d detector(-to_source.y(), to_source.x());
    const Eigen::Vector2d source = options_.source_mm / slice.pixel_mm * to_source + middle;
    for (int channel = 0; channel < options_.num_channels; ++channel) {
      const double u_mm = (channel - centre_) * options_.channel_mm;
      const Eigen::Array2f sum =
          SumAlong(slice, body, source, u_mm * detector - options_.source_mm * to_source);
      lengths.water(channel, view) = sum[0] * static_cast<float>(slice.pixel_mm);
      lengths.bone(channel, view) = sum[1] * static_cast<float>(slice.pixel_mm);
    }
  }
  return lengths;
}

// A cell is smaller than a channel, so it falls into the two channels beside its ray; its area over
// the width of a channel at its depth is a length.
Eigen::ArrayXXf CtScanner::Splat(const std::vector<MetalCell>& cells,
                                 const std::vector<float>& factor) const {
  Eigen::ArrayXXf lengths = Eigen::ArrayXXf::Zero(options_.num_channels, options_.num_views);
  for (int view = 0; view < options_.num_views; ++view) {
    const Eigen::Vector2d& to_source = to_source_[static_cast<size_t>(view)];
    for (size_t i = 0; i < cells.size(); ++i) {
      const Eigen::Vector2d place(cells[i].x_mm, cells[i].y_mm);
      const double magnified = 1 - place.dot(to_source) / options_.source_mm;
      const double u_mm = (place.y() * to_source.x() - place.x() * to_source.y()) / magnified;
      const double cosine = options_.source_mm / std::hypot(options_.source_mm, u_mm);
      const double length =
          factor[i] * cells[i].area_mm2 / (options_.channel_mm * magnified * cosine);
      const double channel = ChannelAt(u_mm);
      const int lower = static_cast<int>(channel);
      if (channel < 0 || lower + 1 >= options_.num_channels) continue;
      const double part = channel - lower;
      lengths(lower, view) += static_cast<float>(length * (1 - part));
      lengths(lower + 1, view) += static_cast<float>(length * part);
    }
  }
  return lengths;
}

Eigen::ArrayXXf CtScanner::ProjectMetal(const std::vector<MetalCell>& cells) const {
  return Splat(cells, std::vector<float>(cells.size(), 1));
}

Eigen::ArrayXXf CtScanner::Transmission(const TissueLengths& tissue) const {
  Eigen::ArrayXXf sum = Eigen::ArrayXXf::Zero(tissue.water.rows(), tissue.water.cols());
  for (const SpectrumBin& bin : Spectrum()) {
    sum += static_cast<float>(bin.weight) * (-static_cast<float>(bin.water) * tissue.water -
                                             static_cast<float>(bin.bone) * tissue.bone)
                                                .exp();
  }
  return sum;
}

Eigen::ArrayXXf CtScanner::WithMetal(const Eigen::ArrayXXf& free, const TissueSlice& slice,
                                     const TissueLengths& tissue, Metal metal,
                                     const MetalLayers& layers) const {
  Eigen::ArrayXXf all = free;
  for (const std::vector<MetalCell>& cells : layers) {
    std::vector<float> water;
    std::vector<float> bone;
    for (const MetalCell& cell : cells) {
      const Eigen::Array2f displaced = DensityAt(slice, cell);
      water.push_back(displaced[0]);
      bone.push_back(displaced[1]);
    }
    const Eigen::ArrayXXf of_metal = ProjectMetal(cells);
    const Eigen::ArrayXXf no_water = Splat(cells, water);
    const Eigen::ArrayXXf no_bone = Splat(cells, bone);
    for (Eigen::Index ray = 0; ray < all.size(); ++ray) {
      const double metal_mm = of_metal.data()[ray];
      if (metal_mm == 0) continue;
      const double water_mm = tissue.water.data()[ray] - no_water.data()[ray];
      const double bone_mm = tissue.bone.data()[ray] - no_bone.data()[ray];
      const double share =
          Arriving(std::max(0.0, water_mm), std::max(0.0, bone_mm), metal_mm, metal);
      all.data()[ray] +=
          static_cast<float>((share - free.data()[ray]) / static_cast<double>(layers.size()));
    }
  }
  return all.max(0);
}

double CtScanner::WaterLength(double attenuation) const {
  const auto above =
      std::upper_bound(water_attenuation_.begin() + 1, water_attenuation_.end() - 1, attenuation);
  const double high = *above;
  const double low = *(above - 1);
  return static_cast<double>(above - 1 - water_attenuation_.begin()) +
         (attenuation - low) / (high - low);
}

Eigen::ArrayXXf CtScanner::Measure(Eigen::ArrayXXf transmission, uint32_t seed) const {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const double electronic = options_.electronic_photons * options_.electronic_photons;
  for (float& value : transmission.reshaped()) {
    const double photons = options_.photons * value;
    // Poisson's noise by the normal distribution: few photons drown in the electronics' noise.
    const double counted = photons + std::sqrt(photons + electronic) * normal(random);
    const double seen = std::max(counted, options_.least_photons);
    value = static_cast<float>(WaterLength(std::log(options_.photons / seen)));
  }
  return transmission;
}

std::vector<int16_t> CtScanner::Reconstruct(const Eigen::ArrayXXf& lengths, int size,
                                            double pixel_mm) const {
  Eigen::ArrayXf cosine(options_.num_channels);
  for (int channel = 0; channel < options_.num_channels; ++channel) {
    const double u_mm = (channel - centre_) * options_.channel_mm;
    cosine[channel] = static_cast<float>(options_.source_mm / std::hypot(options_.source_mm, u_mm));
  }
  const Eigen::MatrixXf filtered = filter_ * (lengths.colwise() * cosine).matrix();

  const auto num_pixels = static_cast<size_t>(size) * static_cast<size_t>(size);
  std::vector<float> density(num_pixels, 0);
  const auto magnify = static_cast<float>(options_.source_mm);
  const Eigen::ArrayXf x_mm =
      Eigen::ArrayXf::LinSpaced(size, -0.5F, 0.5F) * static_cast<float>((size - 1) * pixel_mm);
  for (int view = 0; view < options_.num_views; ++view) {
    const Eigen::Vector2f s = to_source_[static_cast<size_t>(view)].cast<float>();
    const float* row = filtered.col(view).data();
    for (int y = 0; y < size; ++y) {
      const float y_mm = x_mm[y];
      const Eigen::ArrayXf nearer = magnify / ((magnify - y_mm * s.y()) - s.x() * x_mm);
      const Eigen::ArrayXf place =
          ((y_mm * s.x() - s.y() * x_mm) * nearer / static_cast<float>(options_.channel_mm) +
           static_cast<float>(centre_))
              .max(0)
              .min(static_cast<float>(options_.num_channels) - 1.001F);
      float* out = &density[static_cast<size_t>(y * size)];
      for (int x = 0; x < size; ++x) {
        const int lower = static_cast<int>(place[x]);
        const float part = place[x] - static_cast<float>(lower);
        out[x] += nearer[x] * nearer[x] * (row[lower] + part * (row[lower + 1] - row[lower]));
      }
    }
  }
  std::vector<int16_t> hu(num_pixels);
  const double step = 2 * kPi / options_.num_views;
  std::transform(density.begin(), density.end(), hu.begin(), [step](float sum) {
    return static_cast<int16_t>(std::lround(std::clamp(1000 * (step * sum - 1), -1024.0, 3071.0)));
  });
  return hu;
}

}  // namespace tissueform::testing
