// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/label_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

constexpr size_t kMaxSamples = 10000;
constexpr double kFarthestMm = 24;  // along each axis
constexpr double kCoarseStepMm = 4;

// A fitting map has 0.6 to 0.98 of its bone on the CT's: marrow, pulp and thin walls are not dense,
// and labels may be a voxel too large. Another patient's in the same place has less.
constexpr double kLeastOnBone = 0.5;
// Labels of a voxel more or less are no shift.
constexpr double kLeastMoveMm = 2.5;
constexpr double kClearGain = 0.05;

class BoneSamples {
 public:
  BoneSamples(const LabelledGrid& labels, const HuGrid& ct, double bone_above_hu)
      : ct_(ct), bone_above_hu_(bone_above_hu) {
    const auto is_bone = [](StructureSet set) {
      return (set & kBoneSet & ~SetOf(Structure::kCanal)) != 0;
    };
    const std::vector<StructureSet>& sets = labels.structures.values;
    const auto count = static_cast<size_t>(std::count_if(sets.begin(), sets.end(), is_bone));
    const size_t stride = count / kMaxSamples + 1;
    const std::array<int, 3>& size = ct.geometry.size;
    size_t met = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int z = 0; z < size[2]; ++z) {
      for (int y = 0; y < size[1]; ++y) {
        for (int x = 0; x < size[0]; ++x) {
          if (!is_bone(labels.structures.At(x, y, z))) continue;
          sum += Eigen::Vector3d(x, y, z);
          if (met++ % stride == 0) voxels_.emplace_back(x, y, z);
        }
      }
    }
    if (met > 0) middle_x_ = sum.x() / static_cast<double>(met);
  }

  bool empty() const { return voxels_.empty(); }

  // The share on bone when all are mirrored (or not) and then moved by whole voxels.
  double OnBone(const Eigen::Vector3i& move, bool mirrored) const {
    size_t on_bone = 0;
    for (const Eigen::Vector3i& voxel : voxels_) on_bone += IsBone(Moved(voxel, move, mirrored));
    return static_cast<double>(on_bone) / static_cast<double>(voxels_.size());
  }

  // Of those on one side of the middle, in place. The patient's left has the larger x.
  double OnBoneOfSide(bool left) const {
    size_t count = 0;
    size_t on_bone = 0;
    for (const Eigen::Vector3i& voxel : voxels_) {
      if ((voxel.x() > middle_x_) != left) continue;
      ++count;
      on_bone += IsBone(voxel);
    }
    return static_cast<double>(on_bone) / static_cast<double>(std::max<size_t>(count, 1));
  }

 private:
  Eigen::Vector3i Moved(Eigen::Vector3i voxel, const Eigen::Vector3i& move, bool mirrored) const {
    if (mirrored) voxel.x() = static_cast<int>(std::lround(2 * middle_x_)) - voxel.x();
    return voxel + move;
  }
  size_t IsBone(const Eigen::Vector3i& voxel) const {
    if (!ct_.geometry.Contains(voxel.x(), voxel.y(), voxel.z())) return 0;
    return ct_.At(voxel.x(), voxel.y(), voxel.z()) > bone_above_hu_ ? 1 : 0;
  }

  const HuGrid& ct_;
  double bone_above_hu_;
  std::vector<Eigen::Vector3i> voxels_;
  double middle_x_ = 0;
};

struct Best {
  double on_bone = -1;
  Eigen::Vector3i move = Eigen::Vector3i::Zero();
};

// The best of the moves `middle` + (-reach .. reach) along each axis.
Best Search(const BoneSamples& samples, bool mirrored, const Eigen::Vector3i& middle, int reach,
            int step) {
  Best best;
  for (int z = -reach; z <= reach; z += step) {
    for (int y = -reach; y <= reach; y += step) {
      for (int x = -reach; x <= reach; x += step) {
        const Eigen::Vector3i move = middle + Eigen::Vector3i(x, y, z);
        const double on_bone = samples.OnBone(move, mirrored);
        if (on_bone > best.on_bone) best = {on_bone, move};
      }
    }
  }
  return best;
}

std::string Hint(const LabelFit& fit) {
  if (fit.best_on_bone < fit.on_bone + kClearGain) return "";
  const std::string how =
      fit.best_is_mirrored ? "mirrored left to right"
                           : absl::StrFormat("moved by (%.0f, %.0f, %.0f) mm", fit.best_move_mm.x(),
                                             fit.best_move_mm.y(), fit.best_move_mm.z());
  return absl::StrFormat(" (hint: %.0f %% if it is %s)", 100 * fit.best_on_bone, how);
}

}  // namespace

LabelFit MeasureLabelFit(const LabelledGrid& labels, const HuGrid& ct, double bone_above_hu) {
  const BoneSamples samples(labels, ct, bone_above_hu);
  LabelFit fit;
  if (samples.empty()) return fit;
  fit.has_bone = true;
  fit.on_bone = samples.OnBone(Eigen::Vector3i::Zero(), false);
  fit.on_bone_left = samples.OnBoneOfSide(true);
  fit.on_bone_right = samples.OnBoneOfSide(false);
  const double voxel_mm = ct.geometry.spacing_mm;
  const int step = std::max(1, static_cast<int>(std::lround(kCoarseStepMm / voxel_mm)));
  const int reach = step * static_cast<int>(std::lround(kFarthestMm / kCoarseStepMm));
  for (const bool mirrored : {false, true}) {
    const Best coarse = Search(samples, mirrored, Eigen::Vector3i::Zero(), reach, step);
    const Best fine = Search(samples, mirrored, coarse.move, step - 1, 1);
    if (fine.on_bone <= fit.best_on_bone) continue;
    fit.best_on_bone = fine.on_bone;
    fit.best_move_mm = voxel_mm * fine.move.cast<double>();
    fit.best_is_mirrored = mirrored;
  }
  return fit;
}

absl::Status CheckLabelFit(const LabelFit& fit) {
  if (!fit.has_bone) return absl::OkStatus();
  if (fit.on_bone < kLeastOnBone) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the label map does not fit the CT: %.0f %% of the labelled bone lies on bone of the CT, "
        "and at least %.0f %% is required%s; is it of this patient and this CT?",
        100 * fit.on_bone, 100 * kLeastOnBone, Hint(fit)));
  }
  const bool clearly_better = fit.best_on_bone > fit.on_bone + kClearGain;
  if (clearly_better && (fit.best_is_mirrored || fit.best_move_mm.norm() > kLeastMoveMm)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the label map is %s: %.0f %% of the labelled bone lies on bone of the CT%s; export it "
        "again with the geometry of the CT",
        fit.best_is_mirrored ? "mirrored" : "shifted", 100 * fit.on_bone, Hint(fit)));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
