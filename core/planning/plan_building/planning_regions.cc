// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/planning_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/skin_regions.h"

namespace tissueform {
namespace {

constexpr uint8_t kFree = 0;
constexpr uint8_t kFixed = 1;

// What a vertex of the boundary touches: a label of bone, or these.
constexpr uint8_t kAir = 0;
constexpr uint8_t kLeftOut = 253;  // tissue that is not modelled: brain, thin sheets, cut off
constexpr uint8_t kCut = 254;

// Half a voxel is what sampling leaves open where a surface lies, and a little for remeshing.
constexpr double kCutVoxels = 0.6;
// So near to the voxels that the scanner's circle cuts what faces air is no skin: half a voxel to
// their faces, and what remeshing leaves open.
constexpr double kAtCutVoxels = 1.2;
// How far from a vertex of the mesh the voxel is looked for that it lies on.
constexpr int kSearchVoxels = 3;

// A cut is no anatomy: so much farther than contacts it keeps from bone that moves.
constexpr double kCutBands = 3;

bool IsOnCut(const Eigen::Vector3d& place, const SoftTissue& soft_tissue) {
  const double reach = kCutVoxels * soft_tissue.labels.geometry.spacing_mm;
  const std::vector<Plane> planes = soft_tissue.region.planes();
  return std::any_of(planes.begin(), planes.end(),
                     [&](const Plane& plane) { return plane.HeightMm(place) < reach; });
}

// Labels are 0 for air and for what was left out of the model (brain, thin sheets): the CT shows
// which. A vertex beside the latter is neither skin nor held.
bool IsAir(const PlanningCt& ct, const Eigen::Vector3d& place) {
  return Interpolate(ct.hu, place) < ct.tissue_above_hu;
}

// The label of the nearest voxel that is not soft tissue; air if no such voxel is near.
uint8_t NearestOther(const Eigen::Vector3d& place, const LabelGrid& labels, const PlanningCt& ct) {
  const auto voxel = NearestVoxel(labels, place, kSearchVoxels,
                                  [](uint8_t label) { return label != kSoftTissue; });
  if (!voxel) return kAir;
  const uint8_t label = labels.At(voxel->x(), voxel->y(), voxel->z());
  const Eigen::Vector3d centre = labels.geometry.Centre(voxel->x(), voxel->y(), voxel->z());
  return label != kAir || IsAir(ct, centre) ? label : kLeftOut;
}

std::vector<uint8_t> TouchedBy(const TetMesh& mesh, Eigen::Index boundary_vertices,
                               const SoftTissue& soft_tissue, const PlanningCt& ct) {
  std::vector<uint8_t> touched(static_cast<size_t>(boundary_vertices));
  const bool has_cut = ct.cut != nullptr && !ct.cut->values.empty();
  const FloatGrid to_cut = has_cut ? DistanceMm(*ct.cut) : FloatGrid();
  for (Eigen::Index v = 0; v < boundary_vertices; ++v) {
    const Eigen::Vector3d place = mesh.positions().row(v);
    uint8_t& by = touched[static_cast<size_t>(v)];
    by = IsOnCut(place, soft_tissue) ? kCut : NearestOther(place, soft_tissue.labels, ct);
    if (by != kAir || !has_cut) continue;
    const double near_mm = kAtCutVoxels * to_cut.geometry.spacing_mm;
    if (Interpolate(to_cut, place) <= near_mm) by = kLeftOut;
  }
  return touched;
}

// Distances from every bone but the one of that label, which the vertices on it keep away from.
FloatGrid DistanceFromOtherBone(const LabelGrid& labels, uint8_t own) {
  return DistanceMm(MaskWhere(labels, [own](uint8_t label) {
    return label != kAir && label != kSoftTissue && label != own;
  }));
}

bool IsBone(uint8_t touched) { return touched != kAir && touched < kLeftOut; }

void FreeCutsNearSegments(const TetMesh& mesh, const LabelGrid& labels,
                          const std::vector<uint8_t>& touched, double nearer_than_mm,
                          std::vector<uint8_t>* anatomy) {
  const FloatGrid distance = DistanceFromOtherBone(labels, kFixedBone);
  for (size_t v = 0; v < touched.size(); ++v) {
    const Eigen::Vector3d place = mesh.positions().row(static_cast<Eigen::Index>(v));
    if (touched[v] == kCut && Interpolate(distance, place) < nearer_than_mm) {
      (*anatomy)[v] = kFree;
    }
  }
}

// The jaw, or the skull, that most of a piece was cut from.
uint8_t PartOf(const LabelGrid& labels, const LabelGrid& parts, uint8_t label) {
  std::array<int64_t, 256> count{};
  for (size_t i = 0; i < labels.values.size(); ++i) {
    if (labels.values[i] == label) ++count[parts.values[i]];
  }
  return static_cast<uint8_t>(std::max_element(count.begin(), count.end()) - count.begin());
}

// Pieces are cut out of what has a smaller label: where such bone of the same part is dissected, it
// lets tissue go, and the piece does not.
FloatGrid DistanceFromContacts(const LabelGrid& labels, const FreeBands& bands, uint8_t own) {
  if (bands.DissectedMm(own) == 0) return DistanceFromOtherBone(labels, own);
  const uint8_t part = PartOf(labels, *bands.parts, own);
  LabelGrid others(labels.geometry);
  for (size_t i = 0; i < labels.values.size(); ++i) {
    const uint8_t label = labels.values[i];
    const bool is_other = label != kAir && label != kSoftTissue && label != own;
    others.values[i] = is_other && (label > own || bands.parts->values[i] != part) ? 1 : 0;
  }
  return DistanceMm(others);
}

// Whether a vertex on a bone lies on this part of it: bone that stays is of several.
bool LiesOn(const Eigen::Vector3d& place, const LabelGrid& bone_of_part) {
  return NearestVoxel(bone_of_part, place, kSearchVoxels, [](uint8_t is) { return is != 0; })
      .has_value();
}

// Takes the constraint from what the surgeon lifts off the bone that each piece was cut from.
void FreeDissected(const TetMesh& mesh, const LabelGrid& labels, const FreeBands& bands,
                   uint8_t piece, const std::vector<uint8_t>& touched,
                   std::vector<uint8_t>* anatomy) {
  const double dissected_mm = bands.DissectedMm(piece);
  if (dissected_mm == 0) return;
  const uint8_t part = PartOf(labels, *bands.parts, piece);
  LabelGrid staying(labels.geometry);
  for (size_t i = 0; i < labels.values.size(); ++i) {
    const uint8_t label = labels.values[i];
    const bool is_staying = label != kAir && label < piece && bands.parts->values[i] == part;
    staying.values[i] = is_staying ? 1 : 0;
  }
  const FloatGrid distance =
      DistanceMm(MaskWhere(labels, [piece](uint8_t label) { return label == piece; }));
  for (size_t v = 0; v < touched.size(); ++v) {
    if (!IsBone(touched[v]) || touched[v] >= piece) continue;
    const Eigen::Vector3d place = mesh.positions().row(static_cast<Eigen::Index>(v));
    const bool is_near = Interpolate(distance, place) < dissected_mm;
    if (is_near && LiesOn(place, staying)) (*anatomy)[v] = kFree;
  }
}

// Takes the constraint from vertices on bone that is too near to bone that moves otherwise.
void FreeContacts(const TetMesh& mesh, const LabelGrid& labels, size_t num_segments,
                  const std::vector<uint8_t>& touched, const FreeBands& bands,
                  std::vector<uint8_t>* anatomy) {
  for (size_t own = kFixedBone; own < kFirstSegment + num_segments; ++own) {
    const auto label = static_cast<uint8_t>(own);
    const FloatGrid distance = DistanceFromContacts(labels, bands, label);
    for (size_t v = 0; v < touched.size(); ++v) {
      if (touched[v] != own) continue;
      const Eigen::Vector3d place = mesh.positions().row(static_cast<Eigen::Index>(v));
      if (Interpolate(distance, place) < bands.contact_mm) (*anatomy)[v] = kFree;
    }
    FreeDissected(mesh, labels, bands, label, touched, anatomy);
  }
  FreeCutsNearSegments(mesh, labels, touched, kCutBands * bands.contact_mm, anatomy);
}

// Takes the constraints of a tet that would be held by two.
void FreeSharedTets(const TetMesh& mesh, std::vector<uint8_t>* anatomy) {
  std::vector<int32_t> freed;
  for (const auto& tet : mesh.tets().rowwise()) {
    uint8_t held = kFree;
    bool shared = false;
    for (const int32_t v : tet) {
      const uint8_t by = (*anatomy)[static_cast<size_t>(v)];
      shared |= held != kFree && by != kFree && by != held;
      held = std::max(held, by);
    }
    if (shared) freed.insert(freed.end(), tet.begin(), tet.end());
  }
  for (const int32_t v : freed) (*anatomy)[static_cast<size_t>(v)] = kFree;
}

absl::Status CheckPresent(const std::vector<uint8_t>& anatomy,
                          const std::vector<std::string>& segments, const FreeBands& bands) {
  for (size_t label = kFixed; label < kFirstSegment + segments.size(); ++label) {
    if (std::find(anatomy.begin(), anatomy.end(), label) != anatomy.end()) continue;
    const std::string what =
        label == kFixed ? "the fixed bone and the cuts have"
                        : absl::StrCat("segment ", segments[label - kFirstSegment], " has");
    return absl::InvalidArgumentError(
        absl::StrCat(what, " no vertices left with a contact band of ", bands.contact_mm,
                     " mm; use a smaller \"contact_band_mm\"",
                     bands.dissected_mm.empty() ? "" : " or \"dissected_mm\"", " or a finer mesh"));
  }
  return absl::OkStatus();
}

std::vector<uint8_t> RegionsOfSkin(const TetMesh& mesh, const std::vector<bool>& on_skin,
                                   const Landmarks& landmarks, const MouthLine* mouth) {
  const std::vector<SkinRegion> names = NameSkinRegions(mesh.positions(), landmarks, mouth);
  std::vector<uint8_t> regions(names.size(), 0);
  for (size_t v = 0; v < names.size(); ++v) {
    if (on_skin[v]) regions[v] = static_cast<uint8_t>(names[v]);
  }
  return regions;
}

}  // namespace

double FreeBands::DissectedMm(uint8_t label) const {
  const size_t s = size_t{label} - kFirstSegment;
  return label >= kFirstSegment && s < dissected_mm.size() ? dissected_mm[s] : 0;
}

double LargestMoveMm(const LabelGrid& labels, uint8_t label, const HandlePose& pose) {
  double largest = 0;
  const LabelGrid segment = MaskWhere(labels, [label](uint8_t value) { return value == label; });
  ForEachVoxel(segment, [&](size_t /*index*/, const Eigen::Vector3d& place) {
    largest = std::max(largest, (ApplyPose(pose, place) - place).norm());
  });
  return largest;
}

absl::StatusOr<PlanningRegions> AssignRegions(const TetMesh& mesh, Eigen::Index boundary_vertices,
                                              const SoftTissue& soft_tissue,
                                              const std::vector<std::string>& segments,
                                              const FreeBands& bands, const Landmarks& landmarks,
                                              const PlanningCt& ct) {
  const auto num_vertices = static_cast<size_t>(mesh.num_vertices());
  const std::vector<uint8_t> touched = TouchedBy(mesh, boundary_vertices, soft_tissue, ct);
  PlanningRegions regions;
  regions.anatomy.assign(num_vertices, kFree);
  regions.on_skin.assign(num_vertices, false);
  regions.bone.assign(num_vertices, 0);
  for (size_t v = 0; v < touched.size(); ++v) {
    regions.on_skin[v] = touched[v] == kAir;
    regions.bone[v] = IsBone(touched[v]) ? touched[v] : 0;
    regions.anatomy[v] = touched[v] == kCut ? kFixed : IsBone(touched[v]) ? touched[v] : kFree;
  }
  const auto constrained = [&regions] {
    return std::count_if(regions.anatomy.begin(), regions.anatomy.end(),
                         [](uint8_t label) { return label != kFree; });
  };
  const int64_t before = constrained();
  FreeContacts(mesh, soft_tissue.labels, segments.size(), touched, bands, &regions.anatomy);
  FreeSharedTets(mesh, &regions.anatomy);
  regions.freed_by_contact = before - constrained();
  TF_RETURN_IF_ERROR(CheckPresent(regions.anatomy, segments, bands));
  regions.skin_region = RegionsOfSkin(mesh, regions.on_skin, landmarks, ct.mouth);
  return regions;
}

}  // namespace tissueform
