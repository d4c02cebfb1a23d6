// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/viewer_landmarks.h"

#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/osteotomy.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// How far from bone a landmark of it may lie: it is the mean of some voxels at an end of it.
constexpr double kOnBoneMm = 4;

// A nose that stands out less is cut off by the CT or pressed flat: it has no tip.
constexpr double kLeastNoseMm = 3;

enum class Jaw { kLower, kUpper };  // with the rest of the skull

// Teeth in occlusion lie nearer to each other than a landmark to its own bone, so only bone of the
// landmark's jaw counts.
uint8_t NearestLabel(const LabelGrid& bone, const LabelGrid& parts, Jaw jaw,
                     const Vector3d& place) {
  const Vector3d voxel = bone.geometry.ToVoxels(place);
  const int reach = static_cast<int>(std::ceil(kOnBoneMm / bone.geometry.spacing_mm));
  uint8_t nearest = 0;
  double least_mm = kOnBoneMm;
  for (int dz = -reach; dz <= reach; ++dz) {
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const int x = static_cast<int>(std::lround(voxel.x())) + dx;
        const int y = static_cast<int>(std::lround(voxel.y())) + dy;
        const int z = static_cast<int>(std::lround(voxel.z())) + dz;
        if (!bone.geometry.Contains(x, y, z) || bone.At(x, y, z) == 0) continue;
        if ((parts.At(x, y, z) == kMandible) != (jaw == Jaw::kLower)) continue;
        const double distance = (bone.geometry.Centre(x, y, z) - place).norm();
        if (distance >= least_mm) continue;
        least_mm = distance;
        nearest = bone.At(x, y, z);
      }
    }
  }
  return nearest;
}

class LandmarkList {
 public:
  LandmarkList(const LabelGrid& bone, const LabelGrid& parts,
               const std::vector<std::string>& segments, const CaseSurface& skin)
      : bone_(bone), parts_(parts), segments_(segments), skin_(skin) {}

  void AddBone(Jaw jaw, const std::string& name, const std::string& label, const Vector3d& place) {
    CaseLandmark landmark{.name = name, .label = label, .position_mm = place};
    const uint8_t nearest = NearestLabel(bone_, parts_, jaw, place);
    if (nearest >= kFirstSegment) landmark.handle = segments_[nearest - kFirstSegment];
    list_.push_back(std::move(landmark));
  }
  void AddBone(Jaw jaw, const std::string& name, const std::string& label,
               const LeftAndRight& places) {
    AddBone(jaw, absl::StrCat(name, "_left"), absl::StrCat(label, ", left"), places.left);
    AddBone(jaw, absl::StrCat(name, "_right"), absl::StrCat(label, ", right"), places.right);
  }
  void AddSkin(const std::string& name, const std::string& label, const Vector3d& place) {
    Index nearest = 0;
    const Eigen::RowVector3f at = place.cast<float>().transpose();
    (skin_.positions.rowwise() - at).rowwise().squaredNorm().minCoeff(&nearest);
    list_.push_back({.name = name,
                     .label = label,
                     .position_mm = place,
                     .skin_vertex = static_cast<int32_t>(nearest)});
  }

  std::vector<CaseLandmark> Take() { return std::move(list_); }

 private:
  const LabelGrid& bone_;
  const LabelGrid& parts_;
  const std::vector<std::string>& segments_;
  const CaseSurface& skin_;
  std::vector<CaseLandmark> list_;
};

}  // namespace

std::vector<CaseLandmark> MakeViewerLandmarks(const Landmarks& landmarks,
                                              const std::optional<FrankfortLandmarks>& frankfort,
                                              const LabelGrid& bone, const LabelGrid& parts,
                                              const std::vector<std::string>& segments,
                                              const CaseSurface& skin) {
  const Landmarks& l = landmarks;
  LandmarkList list(bone, parts, segments, skin);
  list.AddBone(Jaw::kUpper, "upper_incisor", "Upper incisor", l.upper_incisor);
  list.AddBone(Jaw::kLower, "lower_incisor", "Lower incisor", l.lower_incisor);
  list.AddBone(Jaw::kUpper, "upper_molar", "Upper molar", l.upper_molar);
  list.AddBone(Jaw::kLower, "lower_molar", "Lower molar", l.lower_molar);
  list.AddBone(Jaw::kLower, "pogonion", "Pogonion", l.pogonion);
  list.AddBone(Jaw::kLower, "menton", "Menton", l.menton);
  list.AddBone(Jaw::kLower, "gonion", "Gonion", l.gonion);
  list.AddBone(Jaw::kLower, "condyle", "Condyle", l.condyle);
  if (frankfort) {
    list.AddBone(Jaw::kUpper, "porion", "Porion", frankfort->porion);
    list.AddBone(Jaw::kUpper, "orbitale", "Orbitale", frankfort->orbitale);
  }
  if (l.nose_prominence_mm >= kLeastNoseMm) list.AddSkin("pronasale", "Nose tip", l.nose_tip);
  list.AddSkin("subnasale", "Subnasale", l.subnasale);
  list.AddSkin("labrale_superius", "Upper lip", l.upper_lip);
  list.AddSkin("labrale_inferius", "Lower lip", l.lower_lip);
  list.AddSkin("soft_pogonion", "Soft pogonion", l.skin_pogonion);
  return list.Take();
}

}  // namespace tissueform
