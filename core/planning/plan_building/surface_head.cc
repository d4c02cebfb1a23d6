// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/surface_head.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/scanner_cut.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/planning/plan_building/closed_skin.h"
#include "core/planning/plan_building/solid_voxels.h"

namespace tissueform {
namespace {

constexpr double kAirHu = -1000;
// Bone deeper than one voxel: dense enough to count as teeth, which are part of the bones here.
constexpr double kDeepBoneHu = 1600;
constexpr double kSkinHuPerVoxel = 500;
constexpr double kBoneHuPerVoxel = 250;

constexpr int kMarginVoxels = 5;
// Heads from that of a small child to one with neck and shoulders.
constexpr double kSmallestSkinMm = 80;
constexpr double kLargestSkinMm = 600;
// Bone outside the skin: skin and teeth that touch differ by the surfaces' own errors.
constexpr double kLargestOutsideFraction = 0.03;
// Rami lie behind the body of a jaw by 20 to 40 mm.
constexpr double kRamusInFrontMm = 5;

absl::Status CheckSkinSize(const Eigen::AlignedBox3d& box) {
  const double size_mm = box.sizes().maxCoeff();
  if (size_mm >= kSmallestSkinMm && size_mm <= kLargestSkinMm) return absl::OkStatus();
  const char* unit = size_mm < 1 ? "m" : "cm";
  const std::string advice =
      size_mm < 50
          ? absl::StrCat("are its coordinates in another unit (\"units\": \"", unit, "\")?")
          : "check \"units\" or \"scale\"";
  return absl::InvalidArgumentError(
      absl::StrFormat("the skin is %.3g mm long; a head with its neck is %g to %g mm: %s", size_mm,
                      kSmallestSkinMm, kLargestSkinMm, advice));
}

GridGeometry GridAround(const Eigen::AlignedBox3d& box, double spacing_mm) {
  GridGeometry geometry;
  geometry.spacing_mm = spacing_mm;
  geometry.origin_mm = box.min() - Eigen::Vector3d::Constant(kMarginVoxels * spacing_mm);
  for (int axis = 0; axis < 3; ++axis) {
    geometry.size[static_cast<size_t>(axis)] =
        static_cast<int>(std::ceil(box.sizes()[axis] / spacing_mm)) + 2 * kMarginVoxels + 1;
  }
  return geometry;
}

double HuAt(double to_skin_voxels, double to_bone_voxels) {
  const double skin = std::clamp(kSkinHuPerVoxel * (to_skin_voxels - 1), kAirHu, 0.0);
  if (to_bone_voxels >= 1) return kDeepBoneHu;
  const double bone = std::max(0.0, kBoneHuPerVoxel * (to_bone_voxels + 1));
  return to_bone_voxels > 0 ? std::max(bone, skin + bone) : skin + bone;
}

// Works on one head: makes its parts one after the other.
class HeadMaker {
 public:
  HeadMaker(const HeadSurfaces& surfaces, int threads) : surfaces_(surfaces), threads_(threads) {}

  absl::StatusOr<SurfaceHead> Make(double spacing_mm, const StageFunction& on_stage) {
    ReportStage(on_stage, "closing the skin", 0);
    const ClosedSkin skin = CloseSkin(surfaces_.skin, &made_.notes);
    const Eigen::AlignedBox3d box = BoxOf(skin.skin);
    TF_RETURN_IF_ERROR(CheckSkinSize(box));
    const GridGeometry geometry = GridAround(box, spacing_mm);
    TF_ASSIGN_OR_RETURN(LabelGrid head,
                        SolidOf(skin.skin, "the skin", geometry, threads_, skin.open));
    ReportStage(on_stage, "filling bones with voxels", 0.2);
    TF_RETURN_IF_ERROR(FindBones(geometry));
    TF_RETURN_IF_ERROR(CheckUpright());
    TF_RETURN_IF_ERROR(CheckBoneInSkin(skin, &head));
    ReportStage(on_stage, "measuring distances", 0.5);
    MakeVoxels(std::move(head), skin);
    return std::move(made_);
  }

 private:
  absl::Status FindBones(const GridGeometry& geometry) {
    LabelGrid& labels = made_.parts.labels;
    labels = LabelGrid(geometry);
    TF_RETURN_IF_ERROR(AddBone(surfaces_.skull, "the skull", kCranium, &labels));
    TF_RETURN_IF_ERROR(AddBone(surfaces_.lower_jaw, "the lower jaw", kMandible, &labels));
    made_.parts.separation = JawSeparation::kGiven;
    made_.parts.confidence = 1;
    if (surfaces_.segments.empty()) return absl::OkStatus();
    LabelGrid pieces(geometry);
    for (size_t s = 0; s < surfaces_.segments.size(); ++s) {
      const SegmentSurface& segment = surfaces_.segments[s];
      TF_RETURN_IF_ERROR(AddBone(segment.mesh, absl::StrCat("segment \"", segment.name, "\""),
                                 static_cast<uint8_t>(kFirstSegment + s), &pieces));
    }
    MergePieces(std::move(pieces));
    return absl::OkStatus();
  }

  absl::Status AddBone(const TriangleMesh& mesh, const std::string& what, uint8_t label,
                       LabelGrid* labels) {
    TF_ASSIGN_OR_RETURN(LabelGrid inside, SolidOf(mesh, what, labels->geometry, threads_));
    TF_RETURN_IF_ERROR(MarkSolid(inside, what, label, labels));
    bones_.push_back({&mesh, std::move(inside)});
    return absl::OkStatus();
  }

  // A piece may be given beside the bone that it was cut from, or within it.
  void MergePieces(LabelGrid pieces) {
    LabelGrid& parts = made_.parts.labels;
    for (size_t i = 0; i < pieces.values.size(); ++i) {
      uint8_t& piece = pieces.values[i];
      if (piece >= kFirstSegment) {
        const bool lower = surfaces_.segments[piece - size_t{kFirstSegment}].of_lower_jaw;
        parts.values[i] = lower ? kMandible : kCranium;
      } else if (parts.values[i] != 0) {
        piece = kFixedBone;
      }
    }
    made_.segments = std::move(pieces);
  }

  struct Extent {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double low_z = 0;
    double high_z = 0;
  };
  Extent ExtentOf(uint8_t part, double above_z) const {
    Extent extent{.low_z = INFINITY, .high_z = -INFINITY};
    int64_t count = 0;
    ForEachVoxel(made_.parts.labels, [&](size_t index, const Eigen::Vector3d& place) {
      if (made_.parts.labels.values[index] != part || place.z() < above_z) return;
      extent.center += place;
      extent.low_z = std::min(extent.low_z, place.z());
      extent.high_z = std::max(extent.high_z, place.z());
      ++count;
    });
    extent.center /= static_cast<double>(std::max<int64_t>(count, 1));
    return extent;
  }

  absl::Status CheckUpright() const {
    const Extent skull = ExtentOf(kCranium, -INFINITY);
    const Extent jaw = ExtentOf(kMandible, -INFINITY);
    if (skull.center.z() <= jaw.center.z()) {
      return absl::InvalidArgumentError(
          "the lower jaw lies above the skull: z must point from the feet to the head; check the "
          "axes, and that skull and lower jaw are not exchanged");
    }
    const Extent rami = ExtentOf(kMandible, (jaw.low_z + jaw.high_z) / 2);
    if (rami.center.y() > jaw.center.y() - kRamusInFrontMm) return absl::OkStatus();
    return absl::InvalidArgumentError(
        "the face looks backward: the rami of the lower jaw are in front of its body; in LPS y "
        "points backward. Give \"coordinate_system\": \"RAS\" if the surfaces are in RAS");
  }

  // Bone beyond an opening of the skin is not part of the head; elsewhere it belongs to it.
  absl::Status CheckBoneInSkin(const ClosedSkin& skin, LabelGrid* head) {
    std::vector<size_t> outside;
    std::vector<Eigen::Vector3d> places;
    int64_t num_bone = 0;
    ForEachVoxel(made_.parts.labels, [&](size_t index, const Eigen::Vector3d& place) {
      ++num_bone;
      if (head->values[index] != 0) return;
      outside.push_back(index);
      places.push_back(place);
    });
    Positions points(static_cast<Eigen::Index>(places.size()), 3);
    for (size_t i = 0; i < places.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = places[i];
    const Eigen::VectorXd to_skin = DistancesToSurface(points, surfaces_.skin, threads_);
    const Eigen::VectorXd to_caps = skin.caps ? DistancesToSurface(points, *skin.caps, threads_)
                                              : Eigen::VectorXd::Constant(points.rows(), INFINITY);
    int64_t exposed = 0;
    for (size_t i = 0; i < outside.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      if (to_caps[row] <= to_skin[row]) {
        RemoveBone(outside[i]);
      } else {
        head->values[outside[i]] = 1;
        ++exposed;
      }
    }
    const double fraction = static_cast<double>(exposed) / static_cast<double>(num_bone);
    if (fraction <= kLargestOutsideFraction) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrFormat(
        "%.0f %% of the bone is outside the skin: are all surfaces from one patient, in one "
        "coordinate system and in one unit, and is the skin the outer surface?",
        100 * fraction));
  }

  void RemoveBone(size_t index) {
    made_.parts.labels.values[index] = 0;
    if (made_.segments) made_.segments->values[index] = 0;
    for (Bone& bone : bones_) bone.inside.values[index] = 0;
  }

  void MakeVoxels(LabelGrid head, const ClosedSkin& skin) {
    const GridGeometry& geometry = head.geometry;
    const FloatGrid to_skin = DistancesNearBorder(head, skin.WithCaps(), threads_);
    FloatGrid to_bone(geometry, -INFINITY);
    for (const Bone& bone : bones_) {
      const FloatGrid to_this = DistancesNearBorder(bone.inside, *bone.mesh, threads_);
      for (size_t i = 0; i < to_bone.values.size(); ++i) {
        to_bone.values[i] = std::max(to_bone.values[i], to_this.values[i]);
      }
    }
    made_.head.hu = HuGrid(geometry);
    for (size_t i = 0; i < to_bone.values.size(); ++i) {
      made_.head.hu.values[i] = static_cast<int16_t>(std::lround(
          HuAt(to_skin.values[i] / geometry.spacing_mm, to_bone.values[i] / geometry.spacing_mm)));
    }
    MarkTissues();
    made_.head.bone = MaskWhere(made_.parts.labels, [](uint8_t part) { return part != 0; });
    made_.head.metal = LabelGrid(geometry);
    made_.head.cut = CutVoxels(head, BeyondCaps(head, skin));
    made_.head.head = std::move(head);
  }

  void MarkTissues() {
    if (surfaces_.tissues.empty()) return;
    made_.tissue_class = LabelGrid(made_.head.hu.geometry);
    for (size_t t = 0; t < surfaces_.tissues.size(); ++t) {
      const SolidVoxels solid =
          FindSolidVoxels(surfaces_.tissues[t], made_.tissue_class->geometry, threads_);
      for (size_t i = 0; i < solid.inside.values.size(); ++i) {
        if (solid.inside.values[i] != 0) {
          made_.tissue_class->values[i] = static_cast<uint8_t>(t + 1);
        }
      }
    }
  }

  // The voxels on the far side of what closes wide openings, as what a scanner did not see.
  LabelGrid BeyondCaps(const LabelGrid& head, const ClosedSkin& skin) const {
    if (!skin.caps) return {};
    LabelGrid beyond(head.geometry);
    const FloatGrid to_head = DistanceMm(head);
    std::vector<size_t> near;
    std::vector<Eigen::Vector3d> places;
    ForEachVoxel(LabelGrid(head.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
      if (head.values[index] != 0 || to_head.values[index] > 2 * head.geometry.spacing_mm) return;
      near.push_back(index);
      places.push_back(place);
    });
    Positions points(static_cast<Eigen::Index>(places.size()), 3);
    for (size_t i = 0; i < places.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = places[i];
    const Eigen::VectorXd to_skin = DistancesToSurface(points, surfaces_.skin, threads_);
    const Eigen::VectorXd to_caps = DistancesToSurface(points, *skin.caps, threads_);
    for (size_t i = 0; i < near.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      if (to_caps[row] < to_skin[row]) beyond.values[near[i]] = 1;
    }
    return beyond;
  }

  struct Bone {
    const TriangleMesh* mesh;
    LabelGrid inside;
  };

  const HeadSurfaces& surfaces_;
  const int threads_;
  std::vector<Bone> bones_;
  SurfaceHead made_;
};

}  // namespace

TetStiffness StiffnessByClass(const TetMesh& mesh, const LabelGrid& tissue_class,
                              const StiffnessTable& table) {
  TetStiffness stiffness;
  for (const auto& tet : mesh.tets().rowwise()) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const int32_t v : tet) center += mesh.positions().row(v).transpose() / 4;
    const Eigen::Vector3i voxel =
        tissue_class.geometry.ToVoxels(center).array().round().cast<int>();
    const bool is_in_grid = tissue_class.geometry.Contains(voxel.x(), voxel.y(), voxel.z());
    const uint8_t in_class = is_in_grid ? tissue_class.At(voxel.x(), voxel.y(), voxel.z()) : 0;
    stiffness.mean_hu.push_back(0);
    stiffness.voxels.push_back(0);
    stiffness.tissue.push_back(in_class);
    stiffness.youngs_modulus_pa.push_back(table[in_class].youngs_modulus_pa);
  }
  stiffness.from_barycentre = mesh.num_tets();
  return stiffness;
}

absl::StatusOr<SurfaceHead> MakeHeadFromSurfaces(const HeadSurfaces& surfaces, double spacing_mm,
                                                 int threads, const StageFunction& on_stage) {
  return HeadMaker(surfaces, threads).Make(spacing_mm, on_stage);
}

}  // namespace tissueform
