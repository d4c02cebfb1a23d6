// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/metal_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "core/imaging/ct/unscanned.h"
#include "core/imaging/metal/carried_skin.h"
#include "core/imaging/metal/parallel_beam.h"
#include "core/imaging/metal/slice_correction.h"
#include "core/imaging/metal/slice_stack.h"

namespace tissueform {
namespace {

constexpr int16_t kInsideMetalHu = 3000;
constexpr int16_t kTissueHu = -500;
constexpr double kMarginMm = 5;
constexpr double kPriorSmoothMm = 0.8;
// Beside the metal of a slice its neighbours hold some of it too, blurred: what is that dense
// there.
constexpr int16_t kBlurredMetalHu = 2000;
constexpr int kPasses = 2;
constexpr double kShownBesideMm = 5;
constexpr int16_t kWholly = 1000;

HuGrid SlicesBetween(const HuGrid& grid, double low_z_mm, double high_z_mm) {
  const auto slice_at = [&](double z_mm) {
    const double z = (z_mm - grid.geometry.origin_mm.z()) / grid.geometry.spacing_mm;
    return std::clamp(static_cast<int>(std::lround(z)), 0, grid.geometry.size[2] - 1);
  };
  const int first = slice_at(low_z_mm);
  HuGrid part;
  part.geometry = grid.geometry;
  part.geometry.size[2] = slice_at(high_z_mm) - first + 1;
  part.geometry.origin_mm = grid.geometry.Centre(0, 0, first);
  const auto begin = grid.values.begin() + grid.geometry.Index(0, 0, first);
  part.values.assign(begin, begin + part.geometry.num_voxels());
  return part;
}

// The part of every slice that is corrected: what holds tissue in slices with metal.
struct Window {
  int first_x = std::numeric_limits<int>::max();
  int first_y = std::numeric_limits<int>::max();
  int last_x = -1;
  int last_y = -1;
};

class VolumeCorrection {
 public:
  VolumeCorrection(const MetalFindings& findings, CtVolume* volume)
      : volume_(*volume), stack_(*volume), mask_(findings.mask) {
    for (int slice = 0; slice < stack_.slices; ++slice) {
      if (HasMetal(slice)) slices_.push_back(slice);
    }
    FindWindow();
    beam_ = std::make_unique<ParallelBeam>(shape_);
  }

  void Run(int threads) {
    const auto size = static_cast<Eigen::Index>(slices_.size());
    ParallelFor(threads, size, 1, [&](Eigen::Index begin, Eigen::Index end) {
      for (Eigen::Index i = begin; i < end; ++i) Correct(slices_[static_cast<size_t>(i)]);
    });
  }

  int corrected_slices() const { return static_cast<int>(slices_.size()); }

 private:
  bool HasMetal(int slice) const {
    for (int y = 0; y < stack_.shape.height; ++y) {
      for (int x = 0; x < stack_.shape.width; ++x) {
        if (IsMetal(slice, x, y)) return true;
      }
    }
    return false;
  }

  bool Marked(int slice, int x, int y) const {
    return slice >= 0 && slice < stack_.slices && mask_[stack_.Index(slice, x, y)] != 0;
  }

  bool IsMetal(int slice, int x, int y) const {
    if (Marked(slice, x, y)) return true;
    return volume_.hu[stack_.Index(slice, x, y)] > kBlurredMetalHu &&
           (Marked(slice - 1, x, y) || Marked(slice + 1, x, y));
  }

  void FindWindow() {
    Window w;
    for (const int slice : slices_) {
      for (int y = 0; y < stack_.shape.height; ++y) {
        for (int x = 0; x < stack_.shape.width; ++x) {
          if (volume_.hu[stack_.Index(slice, x, y)] <= kTissueHu) continue;
          w = {std::min(w.first_x, x), std::min(w.first_y, y), std::max(w.last_x, x),
               std::max(w.last_y, y)};
        }
      }
    }
    const auto dx = static_cast<int>(kMarginMm / stack_.shape.pixel_width_mm);
    const auto dy = static_cast<int>(kMarginMm / stack_.shape.pixel_height_mm);
    first_x_ = std::max(0, w.first_x - dx);
    first_y_ = std::max(0, w.first_y - dy);
    shape_ = stack_.shape;
    shape_.width = std::min(stack_.shape.width - 1, w.last_x + dx) - first_x_ + 1;
    shape_.height = std::min(stack_.shape.height - 1, w.last_y + dy) - first_y_ + 1;
  }

  template <typename Visit>
  void ForEachPixel(int slice, const Visit& visit) const {
    size_t pixel = 0;
    for (int y = 0; y < shape_.height; ++y) {
      for (int x = 0; x < shape_.width; ++x, ++pixel) {
        visit(pixel, stack_.Index(slice, first_x_ + x, first_y_ + y));
      }
    }
  }

  void Correct(int slice) {
    std::vector<float> densities(shape_.num_pixels());
    std::vector<uint8_t> metal(shape_.num_pixels());
    size_t at = 0;
    for (int y = 0; y < shape_.height; ++y) {
      for (int x = 0; x < shape_.width; ++x, ++at) {
        metal[at] = IsMetal(slice, first_x_ + x, first_y_ + y) ? 1 : 0;
      }
    }
    ForEachPixel(slice, [&](size_t pixel, size_t voxel) {
      densities[pixel] = std::max(0.0F, 1 + static_cast<float>(volume_.hu[voxel]) / 1000);
    });
    std::vector<float> image = densities;
    const MetalSlice corrected(*beam_, std::move(densities), std::move(metal));
    // The first prior comes from the slice as it is: where metal shades a whole arch (brackets),
    // one with its rays interpolated, which Meyer et al. begin with, has no arch left.
    const std::vector<float> nothing(image.size(), 0.0F);
    const std::vector<float> interpolated = corrected.Corrected(nothing);
    for (int pass = 0; pass < kPasses; ++pass) {
      image = corrected.Corrected(MakePrior(image, interpolated, shape_, kPriorSmoothMm));
    }
    Write(slice, corrected.metal(), image);
  }

  void Write(int slice, const std::vector<uint8_t>& metal, const std::vector<float>& image) {
    ForEachPixel(slice, [&](size_t pixel, size_t voxel) {
      int16_t& hu = volume_.hu[voxel];
      if (metal[pixel] != 0) {
        if (mask_[voxel] != 0) hu = std::max(hu, kInsideMetalHu);
        return;
      }
      const float value = std::round(1000 * (image[pixel] - 1));
      hu = static_cast<int16_t>(std::clamp(value, -1024.0F, 32767.0F));
    });
  }

  CtVolume& volume_;
  SliceStack stack_;
  const std::vector<uint8_t>& mask_;
  std::vector<int> slices_;
  int first_x_ = 0;
  int first_y_ = 0;
  SliceShape shape_;
  std::unique_ptr<ParallelBeam> beam_;
};

}  // namespace

MetalReport ReduceMetalArtifacts(const MetalFindings& findings, int threads, CtVolume* volume) {
  MetalReport report;
  report.threshold_hu = findings.threshold_hu;
  if (!findings.any()) return report;
  VolumeCorrection correction(findings, volume);
  correction.Run(threads);
  report.clusters = findings.clusters;
  report.corrected_slices = correction.corrected_slices();
  report.low_z_mm = std::numeric_limits<double>::max();
  report.high_z_mm = std::numeric_limits<double>::lowest();
  for (const MetalCluster& cluster : findings.clusters) {
    report.volume_mm3 += cluster.volume_mm3;
    report.low_z_mm = std::min(report.low_z_mm, cluster.low_z_mm);
    report.high_z_mm = std::max(report.high_z_mm, cluster.high_z_mm);
  }
  return report;
}

absl::StatusOr<LabelGrid> ResampleMask(const std::vector<uint8_t>& mask, CtVolume volume,
                                       double spacing_mm, int threads) {
  // The mean over a voxel of the grid is the share of it that is in the mask.
  for (size_t i = 0; i < volume.hu.size(); ++i) {
    volume.hu[i] = mask[i] != 0 ? kWholly : int16_t{0};
  }
  TF_ASSIGN_OR_RETURN(const HuGrid share,
                      ResampleIsotropic(volume, spacing_mm, {.threads = threads}));
  LabelGrid metal(share.geometry);
  for (size_t i = 0; i < share.values.size(); ++i) {
    metal.values[i] = share.values[i] >= kWholly / 4 ? 1 : 0;
  }
  return metal;
}

absl::StatusOr<CtWithMetal> ResampleWithoutStreaks(CtVolume volume, double spacing_mm,
                                                   const MetalOptions& options, int threads) {
  CtWithMetal ct;
  MetalFindings findings;
  CarriedSkin carried;
  if (options.correct) findings = FindMetal(volume, options.threshold_hu);
  const ResampleOptions resample = {.threads = threads};
  TF_ASSIGN_OR_RETURN(ct.unscanned, ResampleUnscanned(volume, spacing_mm, threads, findings.mask));
  if (findings.any()) {
    TF_ASSIGN_OR_RETURN(ct.before, ResampleIsotropic(volume, spacing_mm, resample));
    ct.report = ReduceMetalArtifacts(findings, threads, &volume);
    carried = CarrySkinOver(findings, threads, &volume);
    ct.before = SlicesBetween(ct.before, ct.report.low_z_mm - kShownBesideMm,
                              ct.report.high_z_mm + kShownBesideMm);
  }
  TF_ASSIGN_OR_RETURN(ct.hu, ResampleIsotropic(volume, spacing_mm, resample));
  if (!carried.mask.empty()) {
    ct.report.carried = {carried.slices, carried.filled_mm3, carried.removed_mm3};
    TF_ASSIGN_OR_RETURN(ct.carried_skin, ResampleMask(carried.mask, volume, spacing_mm, threads));
  }
  if (findings.any()) {
    TF_ASSIGN_OR_RETURN(ct.metal,
                        ResampleMask(findings.mask, std::move(volume), spacing_mm, threads));
  }
  return ct;
}

}  // namespace tissueform
