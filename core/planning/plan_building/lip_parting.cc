// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/lip_parting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/mesh/seam/seam_sheet.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// Tissue with a wider gap before a jaw is not asked whether it meets it.
constexpr double kWidestGapMm = 5;
// Cosines between the normal of tissue's boundary and that of the arch. Tissue between two teeth
// slides as that before them does: were it held, it would hold the lips. Not so behind the teeth.
constexpr double kFacesLips = -0.5;
constexpr double kFacesLipsThroughAir = 0.3;
// Behind the front of a jaw, whose polynomial is true to about 2 mm.
constexpr double kBehindFrontMm = 4;
// Lips that do not touch along a wider stretch of the mouth are apart in the CT, and not sealed.
// The Visible Human has vertices at most 4 mm apart there.
constexpr double kWidestOpenStretchMm = 10;
// How far from a vertex the voxel of the jaw is looked for that it lies on.
constexpr int kSearchVoxels = 3;

// Normals of facets at their vertices, weighted by area, of length 1 or 0; one row for each of
// `positions`.
Positions NormalsOf(const TriangleIndices& facets, const Positions& positions) {
  Positions normals = Positions::Zero(positions.rows(), 3);
  for (const auto& facet : facets.rowwise()) {
    const Eigen::Vector3d from = positions.row(facet[0]);
    const Eigen::Vector3d to_second = positions.row(facet[1]).transpose() - from;
    const Eigen::Vector3d to_third = positions.row(facet[2]).transpose() - from;
    for (const int32_t v : facet) normals.row(v) += to_second.cross(to_third).transpose();
  }
  normals.rowwise().normalize();
  return normals;
}

bool IsBoneLabel(uint8_t label) { return label != 0 && label != kSoftTissue; }

// kCranium or kMandible, or 0 where neither is near.
uint8_t JawNear(const LabelGrid& parts, const Eigen::Vector3d& place) {
  const auto voxel = NearestVoxel(parts, place, kSearchVoxels, [](uint8_t part) {
    return part == kCranium || part == kMandible;
  });
  return voxel ? parts.At(voxel->x(), voxel->y(), voxel->z()) : 0;
}

// What of a jaw lies at a vertex, or before it.
struct JawAt {
  uint8_t bone = 0;  // label of the soft tissue's grid: 1 stays, 2.. segments
  uint8_t jaw = 0;   // kCranium or kMandible; 0: none
  double gap_mm = 0;
};

class ContactRows {
 public:
  ContactRows(const LipSeam& seam, const VestibuleAnatomy& anatomy, const TetMesh& mesh,
              const PlanningRegions& regions)
      : seam_(seam),
        anatomy_(anatomy),
        mesh_(mesh),
        regions_(regions),
        normals_(NormalsOf(BoundaryFacets(mesh), mesh.positions())) {}

  // Vertices on the seam that are held by bone and touch it in no row, such as those behind a
  // tooth. They stay one, as a row would take them from the bone.
  std::vector<bool> StayJoined(const std::vector<int8_t>& side) const {
    std::vector<bool> stay(side.size(), false);
    for (Eigen::Index v = 0; v < mesh_.num_vertices(); ++v) {
      const auto at = static_cast<size_t>(v);
      if (side[at] != 0 || regions_.anatomy[at] == 0) continue;
      std::vector<ContactRow> rows;
      AddBoneRow(v, 1, &rows);
      stay[at] = rows.empty();
    }
    return stay;
  }

  // `side` of every vertex of the welded mesh.
  std::vector<ContactRow> Run(const std::vector<int8_t>& side, const PartedMesh& parted) const {
    std::vector<ContactRow> rows;
    const auto doubles = static_cast<Eigen::Index>(parted.original_of_double.size());
    std::vector<bool> is_doubled(side.size(), false);
    for (const int32_t v : parted.original_of_double) is_doubled[v] = true;
    for (Eigen::Index v = 0; v < mesh_.num_vertices(); ++v) {
      const auto at = static_cast<size_t>(v);
      if (is_doubled[at]) {
        AddBoneRow(v, 1, &rows);
      } else if (side[at] != 0) {
        AddBoneRow(v, side[at], &rows);
      }
    }
    for (Eigen::Index k = 0; k < doubles; ++k) {
      const size_t before = rows.size();
      AddBoneRow(parted.original_of_double[static_cast<size_t>(k)], -1, &rows);
      const auto number = static_cast<int32_t>(mesh_.num_vertices() + k);
      for (size_t row = before; row < rows.size(); ++row) rows[row].vertex = number;
    }
    AddLipRows(parted, &rows);
    return rows;
  }

 private:
  bool IsInVestibule(const Eigen::Vector3d& place) const {
    return seam_.IsBeside(place, anatomy_.vestibule_mm) &&
           std::abs(seam_.HeightMm(place)) <= anatomy_.vestibule_mm;
  }

  JawAt BoneUnder(Eigen::Index v) const {
    const Eigen::Vector3d place = mesh_.positions().row(v);
    const uint8_t bone = regions_.bone[static_cast<size_t>(v)];
    if (bone != 0) return {.bone = bone, .jaw = JawNear(anatomy_.parts, place)};
    return regions_.on_skin[static_cast<size_t>(v)] ? BoneBehindAir(v, place) : JawAt{};
  }

  // Through the air before a vertex, as the boundary faces.
  JawAt BoneBehindAir(Eigen::Index v, const Eigen::Vector3d& place) const {
    const GridGeometry& geometry = anatomy_.soft_tissue.geometry;
    const Eigen::Vector3d outward = normals_.row(v);
    const double step_mm = geometry.spacing_mm / 4;
    const auto steps = static_cast<int>(kWidestGapMm / step_mm);
    for (int step = 1; step <= steps; ++step) {
      const Eigen::Vector3d ahead = place + step * step_mm * outward;
      const Eigen::Vector3i voxel = geometry.ToVoxels(ahead).array().round().cast<int>();
      if (!geometry.Contains(voxel.x(), voxel.y(), voxel.z())) return {};
      const uint8_t label = anatomy_.soft_tissue.At(voxel.x(), voxel.y(), voxel.z());
      if (!IsBoneLabel(label)) continue;
      return {.bone = label, .jaw = JawNear(anatomy_.parts, ahead), .gap_mm = (step - 1) * step_mm};
    }
    return {};
  }

  void AddBoneRow(Eigen::Index v, int side, std::vector<ContactRow>* rows) const {
    const Eigen::Vector3d place = mesh_.positions().row(v);
    if (!IsInVestibule(place)) return;
    const JawAt under = BoneUnder(v);
    if (under.jaw == 0) return;
    const Eigen::Vector3d outward = seam_.Outward(place, under.jaw, anatomy_.up);
    const bool touches = regions_.bone[static_cast<size_t>(v)] != 0;
    const bool faces_lips =
        -normals_.row(v).dot(outward.transpose()) > (touches ? kFacesLips : kFacesLipsThroughAir) &&
        seam_.BeforeArchMm(place, under.jaw) > -kBehindFrontMm;
    if (!faces_lips) return;
    const bool is_own = (under.jaw == kCranium) == (side > 0);
    rows->push_back(
        {.vertex = static_cast<int32_t>(v),
         .handle = under.bone < kFirstSegment ? ContactRow::kFixedBone : under.bone - kFirstSegment,
         .normal = outward,
         .gap_mm = under.gap_mm,
         .bilateral = is_own && touches});
  }

  void AddLipRows(const PartedMesh& parted, std::vector<ContactRow>* rows) const {
    const Positions up = NormalsOf(parted.wall, mesh_.positions());
    for (size_t k = 0; k < parted.original_of_double.size(); ++k) {
      const int32_t original = parted.original_of_double[k];
      rows->push_back(
          {.vertex = original,
           .other = static_cast<int32_t>(mesh_.num_vertices()) + static_cast<int32_t>(k),
           .normal = up.row(original)});
    }
  }

  const LipSeam& seam_;
  const VestibuleAnatomy& anatomy_;
  const TetMesh& mesh_;  // not yet parted
  const PlanningRegions& regions_;
  Positions normals_;
};

// REQUIRES: the doubles are in the mesh and in the regions.
LipEdge EdgeOf(const LipSeam& seam, const std::vector<int32_t>& originals,
               const Eigen::Vector3d& up, const Positions& positions,
               const PlanningRegions& regions) {
  LipEdge edge{.up = up, .pairs = {}};
  std::vector<Eigen::Vector3d> places;
  const Eigen::Index welded = positions.rows() - static_cast<Eigen::Index>(originals.size());
  for (size_t k = 0; k < originals.size(); ++k) {
    const int32_t upper = originals[k];
    const bool is_skin = regions.skin_region[static_cast<size_t>(upper)] != 0;
    if (!is_skin || !seam.ClosesAt(positions.row(upper))) continue;
    edge.pairs.push_back({.upper = upper, .lower = static_cast<int32_t>(welded + k)});
    places.emplace_back(positions.row(upper));
  }
  if (seam.WidestStretchWithoutMm(places) > kWidestOpenStretchMm) edge.pairs.clear();
  return edge;
}

std::vector<uint8_t> BitsOf(const std::vector<ContactRow>& rows, Eigen::Index num_vertices) {
  std::vector<uint8_t> bits(static_cast<size_t>(num_vertices), 0);
  for (const ContactRow& row : rows) {
    if (row.other != ContactRow::kBone) {
      bits[row.vertex] |= kMeetsOtherLip;
      bits[row.other] |= kMeetsOtherLip;
    } else {
      bits[row.vertex] |= row.bilateral ? kSlides : kMeetsBone;
    }
  }
  return bits;
}

// On the skin the lips meet at the seam.
void NameLips(const LipSeam& seam, const TetMesh& mesh, PlanningRegions* regions) {
  constexpr auto kUpper = static_cast<uint8_t>(SkinRegion::kUpperLip);
  constexpr auto kLower = static_cast<uint8_t>(SkinRegion::kLowerLip);
  for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
    uint8_t& region = regions->skin_region[static_cast<size_t>(v)];
    const bool is_lip = region == kUpper || region == kLower;
    const Eigen::Vector3d place = mesh.positions().row(v);
    if (is_lip) region = seam.HeightMm(place) < 0 ? kLower : kUpper;
  }
}

void AppendDoubles(const std::vector<int32_t>& originals, PlanningRegions* regions) {
  for (const int32_t v : originals) {
    const auto at = static_cast<size_t>(v);
    regions->anatomy.push_back(regions->anatomy[at]);
    regions->bone.push_back(regions->bone[at]);
    regions->on_skin.push_back(regions->on_skin[at]);
    const bool is_skin = regions->skin_region[at] != 0;
    regions->skin_region.push_back(is_skin ? static_cast<uint8_t>(SkinRegion::kLowerLip) : 0);
    if (is_skin) regions->skin_region[at] = static_cast<uint8_t>(SkinRegion::kUpperLip);
  }
}

}  // namespace

absl::StatusOr<MouthLine> ChooseMouthLine(const RecipeLips& lips, const HeadSegmentation& head,
                                          const Landmarks& landmarks) {
  if (!lips.mouth_line_mm.empty()) return MouthLineThrough(lips.mouth_line_mm, landmarks);
  return FindMouthLine(head, landmarks);
}

absl::StatusOr<SeamInMesh> PutSeamInMesh(LipSeam seam, SoftTissueMesh* made) {
  const SeamSheet sheet = {
      .height = [&seam](const Eigen::Vector3d& place) { return seam.HeightMm(place); },
      .holds = [&seam](const Eigen::Vector3d& place) { return seam.Holds(place); }};
  TF_ASSIGN_OR_RETURN(SeamedMesh seamed,
                      ConformToSheet(made->mesh, made->surface.num_vertices(), sheet));
  TriangleIndices facets = BoundaryFacets(seamed.mesh);
  TF_ASSIGN_OR_RETURN(
      made->surface,
      TriangleMesh::Create(seamed.mesh.positions().topRows(seamed.boundary_vertices), facets));
  made->mesh = std::move(seamed.mesh);
  MeasureTets(made);
  return SeamInMesh{.seam = std::move(seam),
                    .side = std::move(seamed.side),
                    .num_moved = seamed.num_moved,
                    .num_added = seamed.num_added};
}

absl::StatusOr<PartedLips> PartLips(const SeamInMesh& seam, const VestibuleAnatomy& anatomy,
                                    SoftTissueMesh* made, PlanningRegions* regions) {
  const ContactRows contact_rows(seam.seam, anatomy, made->mesh, *regions);
  TF_ASSIGN_OR_RETURN(PartedMesh parted,
                      PartMesh(made->mesh, seam.side, contact_rows.StayJoined(seam.side)));
  std::vector<ContactRow> rows = contact_rows.Run(seam.side, parted);
  NameLips(seam.seam, made->mesh, regions);
  AppendDoubles(parted.original_of_double, regions);
  made->mesh = std::move(parted.mesh);
  LipEdge edge =
      EdgeOf(seam.seam, parted.original_of_double, anatomy.up, made->mesh.positions(), *regions);
  std::vector<uint8_t> contact = BitsOf(rows, made->mesh.num_vertices());
  return PartedLips{.line = seam.seam.line(),
                    .vestibule_mm = anatomy.vestibule_mm,
                    .num_moved = seam.num_moved,
                    .num_added = seam.num_added,
                    .original_of_double = std::move(parted.original_of_double),
                    .wall = std::move(parted.wall),
                    .rows = std::move(rows),
                    .edge = std::move(edge),
                    .contact = std::move(contact)};
}

}  // namespace tissueform
