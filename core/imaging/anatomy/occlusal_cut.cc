// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/occlusal_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

// Enamel and dentine, and hardly any bone.
constexpr int16_t kToothHu = 1300;
constexpr int16_t kSolidHu = 400;
// About the height of a crown: so far on either side of the plane its row of teeth reaches.
constexpr double kBesideMm = 8;
constexpr double kSmallestToothRowMm3 = 300;
// A head lies tilted and a bite slopes. Between two steps of 4 degrees a plane moves by less than 1
// mm at the ends of a row of teeth, which is less than a voxel.
constexpr std::array<int, 13> kPitchStepsDeg = {-24, -20, -16, -12, -8, -4, 0,
                                                4,   8,   12,  16,  20, 24};
constexpr std::array<int, 5> kRollStepsDeg = {-8, -4, 0, 4, 8};

struct Sample {
  Eigen::Vector3d place_mm;
  double weight;  // how much of the voxel is bone or tooth, up to 1
  bool tooth;
};

std::vector<Sample> SolidSamples(const HuGrid& hu, const DentalBox& box) {
  std::vector<Sample> samples;
  const Eigen::Vector3d low = hu.geometry.ToVoxels(box.low_mm);
  const Eigen::Vector3d high = hu.geometry.ToVoxels(box.high_mm);
  const auto first = [&](int axis) { return std::max(0, static_cast<int>(std::ceil(low[axis]))); };
  const auto last = [&](int axis) {
    return std::min(hu.geometry.size[static_cast<size_t>(axis)] - 1,
                    static_cast<int>(std::floor(high[axis])));
  };
  for (int z = first(2); z <= last(2); ++z) {
    for (int y = first(1); y <= last(1); ++y) {
      for (int x = first(0); x <= last(0); ++x) {
        const int16_t value = hu.At(x, y, z);
        if (value <= kSolidHu) continue;
        const double weight = std::min(1.0, static_cast<double>(value) / kToothHu);
        samples.push_back({hu.geometry.Centre(x, y, z), weight, value > kToothHu});
      }
    }
  }
  return samples;
}

// What lies at each height over a plane through the box's middle, in steps of one voxel. A
// histogram of heights answers for all parallel planes at once, so that a whole search costs one
// pass over the samples for each of the 65 directions.
class HeightProfile {
 public:
  HeightProfile(const std::vector<Sample>& samples, const Plane& through_middle, double step_mm,
                double reach_mm)
      : step_mm_(step_mm), half_(static_cast<int>(reach_mm / step_mm) + 1) {
    const auto size = static_cast<size_t>(2 * half_ + 1);
    solid_.resize(size);
    teeth_.resize(size);
    for (const Sample& sample : samples) {
      // Shared out between the two nearest bins. Rows of voxels that lie half-way between bins
      // would otherwise fill every second one twice, and a plane through the empty ones look clear.
      const double height = through_middle.HeightMm(sample.place_mm) / step_mm + half_;
      const auto lower = static_cast<int>(std::floor(height));
      if (lower < 0 || lower >= 2 * half_) continue;
      const auto bin = static_cast<size_t>(lower);
      const double part = height - lower;
      solid_[bin] += (1 - part) * sample.weight;
      solid_[bin + 1] += part * sample.weight;
      if (sample.tooth) {
        teeth_[bin] += 1 - part;
        teeth_[bin + 1] += part;
      }
    }
  }

  int num_bins() const { return 2 * half_ + 1; }
  double HeightMm(int bin) const { return (bin - half_) * step_mm_; }
  int Bin(double height_mm) const {
    return std::clamp(static_cast<int>(std::lround(height_mm / step_mm_)) + half_, 0, 2 * half_);
  }

  // Voxels of teeth within kBesideMm on the side that has fewer: teeth on one side only are a plane
  // above or below both rows, however clear it is.
  double TeethBeside(int bin) const {
    return std::min(Sum(teeth_, bin - beside(), bin - 1), Sum(teeth_, bin + 1, bin + beside()));
  }
  // Relative to what lies beside it, because crowns that overlap leave no plane quite empty.
  double Clearance(int bin) const {
    const double least =
        std::min(Sum(solid_, bin - beside(), bin - 1), Sum(solid_, bin + 1, bin + beside())) /
        beside();
    return least > 0 ? std::max(0.0, 1 - solid_[static_cast<size_t>(bin)] / least) : 0;
  }

  // Where between the bin and its neighbours the clearance is best, by a parabola through the
  // three; in bins, -0.5 to 0.5, so that a plane does not jump by a voxel where the grid does.
  double PeakBeside(int bin) const {
    if (bin == 0 || bin + 1 == num_bins()) return 0;
    const double below = Clearance(bin - 1);
    const double here = Clearance(bin);
    const double above = Clearance(bin + 1);
    const double bend = below - 2 * here + above;
    if (bend >= 0 || here < std::max(below, above)) return 0;
    return std::clamp((below - above) / (2 * bend), -0.5, 0.5);
  }

 private:
  int beside() const { return std::max(1, static_cast<int>(std::lround(kBesideMm / step_mm_))); }
  static double Sum(const std::vector<double>& values, int first, int last) {
    double sum = 0;
    for (int i = std::max(0, first); i <= std::min(last, static_cast<int>(values.size()) - 1);
         ++i) {
      sum += values[static_cast<size_t>(i)];
    }
    return sum;
  }

  double step_mm_;
  int half_;
  std::vector<double> solid_;
  std::vector<double> teeth_;
};

Plane TurnedPlane(const Eigen::Vector3d& point_mm, int pitch_deg, int roll_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(pitch_deg * kRadians, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(roll_deg * kRadians, Eigen::Vector3d::UnitY()))
                                   .toRotationMatrix();
  return {point_mm, turn * Eigen::Vector3d::UnitZ()};
}

struct Candidate {
  OcclusalCut cut;
  double teeth = 0;
  double tilt_deg = 0;

  // Both rows whole on their sides, not a plane that splits one row; the less tilted of equals: 0.2
  // % a degree is less than any real difference of clearance.
  double Score() const { return cut.clearance * teeth * (1 - 0.002 * tilt_deg); }
};

std::vector<Candidate> AllCandidates(const std::vector<Sample>& samples, const DentalBox& box,
                                     double step_mm) {
  const Eigen::Vector3d middle = (box.low_mm + box.high_mm) / 2;
  const double reach_mm = (box.high_mm.z() - box.low_mm.z()) / 2;
  std::vector<Candidate> candidates;
  for (const int pitch_deg : kPitchStepsDeg) {
    for (const int roll_deg : kRollStepsDeg) {
      const Plane plane = TurnedPlane(middle, pitch_deg, roll_deg);
      const HeightProfile profile(samples, plane, step_mm, reach_mm);
      for (int bin = 0; bin < profile.num_bins(); ++bin) {
        const double height_mm = profile.HeightMm(bin) + step_mm * profile.PeakBeside(bin);
        const Plane moved = {middle + height_mm * plane.normal, plane.normal};
        const double tilt_deg = std::abs(pitch_deg) + std::abs(roll_deg);
        candidates.push_back({{moved, profile.Clearance(bin)}, profile.TeethBeside(bin), tilt_deg});
      }
    }
  }
  return candidates;
}

}  // namespace

std::optional<OcclusalCut> FindOcclusalCut(const HuGrid& hu, const DentalBox& box) {
  const double step_mm = hu.geometry.spacing_mm;
  const std::vector<Candidate> candidates = AllCandidates(SolidSamples(hu, box), box, step_mm);
  double most_teeth = 0;
  for (const Candidate& candidate : candidates) most_teeth = std::max(most_teeth, candidate.teeth);
  if (most_teeth * step_mm * step_mm * step_mm < kSmallestToothRowMm3) return std::nullopt;
  const auto best = std::max_element(
      candidates.begin(), candidates.end(),
      [](const Candidate& a, const Candidate& b) { return a.Score() < b.Score(); });
  return best->cut;
}

OcclusalCut MeasureOcclusalCut(const HuGrid& hu, const DentalBox& box, const Plane& plane) {
  const double reach_mm = kBesideMm + 2 * hu.geometry.spacing_mm;
  const HeightProfile profile(SolidSamples(hu, box), plane, hu.geometry.spacing_mm, reach_mm);
  return {plane, profile.Clearance(profile.Bin(0))};
}

}  // namespace tissueform
