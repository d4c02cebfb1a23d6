// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/given_pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/mesh/border_loops.h"
#include "core/planning/plan_building/closed_skin.h"
#include "core/planning/plan_building/solid_voxels.h"

namespace tissueform {
namespace {

// Surfaces made from the same CT lie on its bone apart from smoothing; those of another patient or
// place cover it here and there.
constexpr double kLeastOnBone = 0.7;
constexpr double kWellOnBone = 0.9;
constexpr double kNearMm = 2;
constexpr Eigen::Index kProbes = 4000;

std::string RoleOf(const RecipeSegment& segment) {
  return absl::StrCat("segment \"", segment.name, "\"");
}

// Places all over a surface, one row each.
Positions ProbesOf(const TriangleMesh& mesh) {
  const Eigen::Index count = std::min(kProbes, mesh.num_triangles());
  Positions probes(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto t = mesh.triangles().row(i * mesh.num_triangles() / count);
    probes.row(i) =
        (mesh.positions().row(t[0]) + mesh.positions().row(t[1]) + mesh.positions().row(t[2])) / 3;
  }
  return probes;
}

// Which part of the probes lies in bone or near it; `to_bone` is the distance of every voxel.
double ShareOnBone(const Positions& probes, const FloatGrid& to_bone) {
  const GridGeometry& geometry = to_bone.geometry;
  const double near_mm = std::max(kNearMm, 1.5 * geometry.spacing_mm);
  Eigen::Index on_bone = 0;
  for (const auto& probe : probes.rowwise()) {
    const Eigen::Vector3d place = probe.transpose();
    const Eigen::Vector3d voxel = geometry.ToVoxels(place).array().round();
    if (!(voxel.cwiseAbs().maxCoeff() < 1e6)) continue;
    const Eigen::Vector3i v = voxel.cast<int>();
    if (!geometry.Contains(v.x(), v.y(), v.z())) continue;
    if (to_bone.At(v.x(), v.y(), v.z()) <= near_mm) ++on_bone;
  }
  return probes.rows() == 0 ? 0 : static_cast<double>(on_bone) / static_cast<double>(probes.rows());
}

// A mistake that leads to coordinates in another place, and what corrects it.
struct Mistake {
  double scale = 1;
  bool turned = false;  // RAS and LPS exchanged
  const char* unit = "";
};
constexpr std::array<Mistake, 9> kMistakes = {{{1, true, ""},
                                               {1000, false, "m"},
                                               {1000, true, "m"},
                                               {10, false, "cm"},
                                               {10, true, "cm"},
                                               {0.1, false, "mm"},
                                               {0.1, true, "mm"},
                                               {0.001, false, "mm"},
                                               {0.001, true, "mm"}}};

std::string Correction(const Mistake& mistake, const SurfaceAxes& axes) {
  std::vector<std::string> keys;
  if (mistake.scale != 1) keys.push_back(absl::StrCat("\"units\": \"", mistake.unit, "\""));
  if (mistake.turned) {
    const bool given_as_ras = axes.coordinate_system == "RAS";
    keys.push_back(absl::StrCat("\"coordinate_system\": \"", given_as_ras ? "LPS" : "RAS", "\""));
  }
  return absl::StrCat("\"surfaces\": {", keys.front(), keys.size() > 1 ? ", " + keys.back() : "",
                      "}");
}

// Says in which axes or unit the surface lies on the bone, if in any.
absl::Status NotOnBone(double share, const Positions& probes, const FloatGrid& to_bone,
                       const SurfaceAxes& axes) {
  const std::string found =
      absl::StrFormat("%.0f %% of its surface lies on bone of the CT", 100 * share);
  for (const Mistake& mistake : kMistakes) {
    Positions corrected = probes * mistake.scale;
    if (mistake.turned) corrected.leftCols(2) *= -1;
    const double better = ShareOnBone(corrected, to_bone);
    if (better < kLeastOnBone) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s; %s %.0f %% does: give %s in the recipe", found,
        mistake.turned ? (mistake.scale == 1 ? "with x and y negated (RAS and LPS exchanged)"
                                             : "in another unit and with x and y negated")
                       : "in another unit",
        100 * better, Correction(mistake, axes)));
  }
  return absl::InvalidArgumentError(
      absl::StrCat(found,
                   ", also not in other axes (RAS) or units: is it of this CT, in the "
                   "CT's coordinates, and before the movement?"));
}

// The surface with its openings closed, and a note on these.
TriangleMesh ClosedPiece(const TriangleMesh& mesh, const std::string& role,
                         std::vector<std::string>* notes) {
  const std::vector<std::vector<int32_t>> loops = BorderLoops(mesh);
  if (loops.empty()) return mesh;
  double widest_mm = 0;
  for (const std::vector<int32_t>& loop : loops) {
    widest_mm = std::max(widest_mm, LoopWidthMm(mesh, loop));
  }
  notes->push_back(
      absl::StrFormat("The surface of %s is open: %d openings were closed, the widest "
                      "%.1f mm wide.",
                      role, static_cast<int>(loops.size()), widest_mm));
  return WithOpeningsClosed(mesh, loops);
}

uint8_t PartOf(const LabelGrid& pieces, uint8_t label, const LabelGrid& parts) {
  std::array<int64_t, 256> count{};
  for (size_t i = 0; i < pieces.values.size(); ++i) {
    if (pieces.values[i] == label) ++count[parts.values[i]];
  }
  return count[kMandible] > count[kCranium] ? kMandible : kCranium;
}

// Gives a piece the shell of its jaw's bone that its surface leaves out.
void TakeShell(uint8_t label, uint8_t part, const LabelGrid& parts, LabelGrid* pieces) {
  const double reach_mm = std::max(kNearMm, 1.5 * parts.geometry.spacing_mm);
  const FloatGrid to_piece =
      DistanceMm(MaskWhere(*pieces, [label](uint8_t value) { return value == label; }));
  LabelGrid behind(parts.geometry);  // bone of the jaw that is not near the piece
  const auto stays = [&](size_t i) { return parts.values[i] == part && pieces->values[i] == 0; };
  for (size_t i = 0; i < parts.values.size(); ++i) {
    behind.values[i] = stays(i) && to_piece.values[i] > reach_mm ? 1 : 0;
  }
  const FloatGrid to_behind = DistanceMm(behind);
  const double free_mm = reach_mm + parts.geometry.spacing_mm;
  for (size_t i = 0; i < parts.values.size(); ++i) {
    const bool is_shell =
        stays(i) && to_piece.values[i] <= reach_mm && to_behind.values[i] > free_mm;
    if (is_shell) pieces->values[i] = label;
  }
}

// Makes the pieces' voxels bone of the head and of their jaws, and bone without a piece stay.
void MergeBone(const std::vector<uint8_t>& part_of, HeadSegmentation* head, LabelGrid* parts,
               LabelGrid* pieces) {
  for (size_t i = 0; i < pieces->values.size(); ++i) {
    if (pieces->values[i] >= kFirstSegment) {
      parts->values[i] = part_of[pieces->values[i] - size_t{kFirstSegment}];
      head->bone.values[i] = 1;
    } else if (parts->values[i] != 0) {
      pieces->values[i] = kFixedBone;
    }
  }
}

absl::Status CheckAllOrNone(const std::vector<RecipeSegment>& segments) {
  const auto given = static_cast<size_t>(
      std::count_if(segments.begin(), segments.end(),
                    [](const RecipeSegment& segment) { return segment.surface.has_value(); }));
  if (given == 0 || given == segments.size()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "some segments have a \"surface\" and some do not; give all as surfaces or all as "
      "osteotomies");
}

Eigen::Vector3d PivotOf(OsteotomyKind kind, const Landmarks& landmarks) {
  if (kind == OsteotomyKind::kGenioplasty) return landmarks.pogonion;
  return kind == OsteotomyKind::kLeFort1 ? landmarks.upper_incisor : landmarks.lower_incisor;
}

const char* PivotName(OsteotomyKind kind) {
  if (kind == OsteotomyKind::kGenioplasty) return "The pogonion of ";
  return kind == OsteotomyKind::kLeFort1 ? "The upper incisor of " : "The lower incisor of ";
}

}  // namespace

absl::StatusOr<SegmentFiles> ReadSegmentFiles(const Recipe& recipe, int threads) {
  TF_RETURN_IF_ERROR(CheckAllOrNone(recipe.segments));
  SurfaceReader reader(recipe.surface_axes, threads);
  SegmentFiles files;
  files.axes = recipe.surface_axes;
  for (const RecipeSegment& segment : recipe.segments) {
    std::optional<TriangleMesh>& piece = files.pieces.emplace_back();
    std::optional<FileMove>& move = files.moves.emplace_back();
    if (segment.surface) {
      TF_ASSIGN_OR_RETURN(piece, reader.Read(*segment.surface, RoleOf(segment)));
    }
    if (segment.move.any()) {
      TF_ASSIGN_OR_RETURN(
          move, ReadMove(segment.move, piece ? &*piece : nullptr, RoleOf(segment), &reader));
    }
  }
  if (reader.num_files() > 0) files.notes = reader.Notes();
  return files;
}

absl::StatusOr<std::optional<LabelGrid>> PlacePieces(const SegmentFiles& files, int threads,
                                                     Recipe* recipe, HeadSegmentation* head,
                                                     BoneParts* parts,
                                                     std::vector<std::string>* notes) {
  if (files.pieces.empty() || !files.pieces.front()) return std::nullopt;
  const FloatGrid to_bone =
      DistanceMm(MaskWhere(parts->labels, [](uint8_t part) { return part != 0; }));
  notes->insert(notes->end(), files.notes.begin(), files.notes.end());
  LabelGrid pieces(parts->labels.geometry);
  for (size_t s = 0; s < files.pieces.size(); ++s) {
    const std::string role = RoleOf(recipe->segments[s]);
    const Positions probes = ProbesOf(*files.pieces[s]);
    const double share = ShareOnBone(probes, to_bone);
    if (share < kLeastOnBone) {
      const absl::Status status = NotOnBone(share, probes, to_bone, files.axes);
      return absl::Status(status.code(), absl::StrCat(role, ": ", status.message()));
    }
    notes->push_back(
        absl::StrFormat("%.0f %% of the surface of %s lies on bone of the CT%s", 100 * share, role,
                        share < kWellOnBone ? ": check the picture of the bone." : "."));
    const TriangleMesh piece = ClosedPiece(*files.pieces[s], role, notes);
    TF_ASSIGN_OR_RETURN(const LabelGrid inside, SolidOf(piece, role, pieces.geometry, threads));
    TF_RETURN_IF_ERROR(MarkSolid(inside, role, static_cast<uint8_t>(kFirstSegment + s), &pieces));
  }
  std::vector<uint8_t> part_of;
  for (size_t s = 0; s < files.pieces.size(); ++s) {
    const auto label = static_cast<uint8_t>(kFirstSegment + s);
    part_of.push_back(PartOf(pieces, label, parts->labels));
    TakeShell(label, part_of.back(), parts->labels, &pieces);
    RecipeSegment& segment = recipe->segments[s];
    if (!segment.kind_given && part_of.back() == kCranium) segment.kind = OsteotomyKind::kLeFort1;
  }
  MergeBone(part_of, head, &parts->labels, &pieces);
  return pieces;
}

void ResolveMoves(const SegmentFiles& files, const Landmarks& landmarks, Recipe* recipe,
                  std::vector<std::string>* notes) {
  for (size_t s = 0; s < files.moves.size(); ++s) {
    if (!files.moves[s]) continue;
    RecipeSegment& segment = recipe->segments[s];
    const std::optional<TriangleMesh>& piece = files.pieces[s];
    const Eigen::Vector3d pivot = piece ? BoxOf(*piece).center() : PivotOf(segment.kind, landmarks);
    segment.pose = PoseOf(files.moves[s]->move, pivot);
    const std::string place =
        absl::StrCat(piece ? "The middle of " : PivotName(segment.kind), RoleOf(segment));
    notes->push_back(MoveNote(place, segment.pose, *files.moves[s]));
  }
}

}  // namespace tissueform
