// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/contact_blocker.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/mechanics/elasticity/tet_strain.h"

namespace tissueform {
namespace {

constexpr int kNoRegion = -2;

// Of every vertex: kNoRegion where it is free.
std::vector<int> RegionsOf(const ConstraintSet& constraints, Eigen::Index num_vertices) {
  std::vector<int> regions(static_cast<size_t>(num_vertices), kNoRegion);
  for (size_t c = 0; c < constraints.constrained().size(); ++c) {
    regions[static_cast<size_t>(constraints.constrained()[c])] =
        constraints.region_of_constrained()[c];
  }
  return regions;
}

// The first two regions that a walk through the mesh from a tet comes to, ring after ring.
void FindRegions(const MeshPreparation& preparation, ContactBlocker* obstacle) {
  const auto& cells = preparation.elements().cells;
  const VertexCells& vertex_cells = preparation.vertex_cells();
  const std::vector<int> regions =
      RegionsOf(preparation.constraints(), preparation.mesh().num_vertices());
  std::vector<bool> seen(regions.size(), false);
  std::vector<int32_t> queue;
  const auto add_corners = [&](Eigen::Index tet) {
    for (int corner = 0; corner < 4; ++corner) {
      const int32_t vertex = cells(tet, corner);
      if (!seen[static_cast<size_t>(vertex)]) {
        seen[static_cast<size_t>(vertex)] = true;
        queue.push_back(vertex);
      }
    }
  };
  add_corners(obstacle->tet);
  bool has_first = false;
  for (size_t next = 0; next < queue.size(); ++next) {
    const int32_t vertex = queue[next];
    const int region = regions[static_cast<size_t>(vertex)];
    if (region != kNoRegion && !has_first) {
      obstacle->first = obstacle->second = region;
      has_first = true;
    } else if (region != kNoRegion && region != obstacle->first) {
      obstacle->second = region;
      return;
    }
    for (Eigen::Index k = vertex_cells.begin(vertex); k < vertex_cells.end(vertex); ++k) {
      add_corners(vertex_cells.cell(k));
    }
  }
}

std::string NameOf(int region, const ConstraintSet& constraints) {
  return region == ConstraintSet::kFixed
             ? "the fixed vertices"
             : absl::StrCat("handle \"", constraints.handles()[static_cast<size_t>(region)].name,
                            "\"");
}

// The position of a point at rest, after `pose`, in the frame that moves with a region by `frame`.
Eigen::Vector3d SeenFrom(const HandlePose& frame, const HandlePose& pose,
                         const Eigen::Vector3d& point) {
  const Eigen::Vector3d x = ApplyPose(pose, point) - frame.translation_mm - frame.pivot_mm;
  return frame.pivot_mm + RotationMatrix(frame.rotation_vector).transpose() * x / frame.scale;
}

Eigen::Vector3d MiddleOf(const HandleRegion& handle, const Positions& rest) {
  return rest(handle.vertices, Eigen::all).colwise().mean().transpose();
}

// Whether the segment from p to q meets the triangle a, b, c (Moeller and Trumbore 1997). Meeting
// its rim counts, so that none slips through between two triangles.
bool Meets(const Eigen::Vector3d& p, const Eigen::Vector3d& q, const Eigen::Vector3d& a,
           const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  constexpr double kRim = 1e-9;
  const Eigen::Vector3d way = q - p, e1 = b - a, e2 = c - a, from = p - a;
  const Eigen::Vector3d normal = way.cross(e2);
  const double determinant = e1.dot(normal);
  if (determinant == 0) {
    return false;
  }
  const double u = from.dot(normal) / determinant;
  const Eigen::Vector3d cross = from.cross(e1);
  const double v = way.dot(cross) / determinant;
  const double along = e2.dot(cross) / determinant;
  return u >= -kRim && v >= -kRim && u + v <= 1 + kRim && along >= 0 && along <= 1;
}

// Whether the segment from p to q meets a face of region `region` at rest.
bool MeetsRegion(const MeshPreparation& preparation, const std::vector<int>& regions, int region,
                 const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
  const auto& cells = preparation.elements().cells;
  const Positions& rest = preparation.mesh().positions();
  for (Eigen::Index tet = 0; tet < preparation.mesh().num_tets(); ++tet) {
    for (int opposite = 0; opposite < 4; ++opposite) {
      const int32_t a = cells(tet, (opposite + 1) % 4), b = cells(tet, (opposite + 2) % 4),
                    c = cells(tet, (opposite + 3) % 4);
      const bool is_its_face = regions[static_cast<size_t>(a)] == region &&
                               regions[static_cast<size_t>(b)] == region &&
                               regions[static_cast<size_t>(c)] == region;
      if (is_its_face && Meets(p, q, rest.row(a), rest.row(b), rest.row(c))) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace

ContactBlocker FindObstacle(const MeshPreparation& preparation, const Positions& positions) {
  ContactBlocker obstacle;
  obstacle.volume_ratio = std::numeric_limits<double>::infinity();
  for (Eigen::Index tet = 0; tet < preparation.mesh().num_tets(); ++tet) {
    const double ratio =
        TetDeformationGradient(preparation.elements(), positions, tet).determinant();
    // Also where it is no number.
    if (obstacle.tet < 0 || !(ratio >= obstacle.volume_ratio)) {
      obstacle.volume_ratio = ratio;
      obstacle.tet = tet;
    }
  }
  FindRegions(preparation, &obstacle);
  return obstacle;
}

std::optional<ContactBlocker> FindCrossing(const MeshPreparation& preparation,
                                           absl::Span<const HandlePose> before,
                                           absl::Span<const HandlePose> after) {
  const ConstraintSet& constraints = preparation.constraints();
  const Positions& rest = preparation.mesh().positions();
  const std::vector<int> regions = RegionsOf(constraints, rest.rows());
  const auto handles = static_cast<int>(constraints.handles().size());
  for (int mover = 0; mover < handles; ++mover) {
    const auto m = static_cast<size_t>(mover);
    const Eigen::Vector3d middle = MiddleOf(constraints.handles()[m], rest);
    for (int region = ConstraintSet::kFixed; region < handles; ++region) {
      const bool is_fixed = region == ConstraintSet::kFixed;
      const HandlePose from = is_fixed ? HandlePose{} : before[static_cast<size_t>(region)];
      const HandlePose to = is_fixed ? HandlePose{} : after[static_cast<size_t>(region)];
      if (region != mover &&
          MeetsRegion(preparation, regions, region, SeenFrom(from, before[m], middle),
                      SeenFrom(to, after[m], middle))) {
        return ContactBlocker{.first = mover, .second = region};
      }
    }
  }
  return std::nullopt;
}

std::string Describe(const ContactBlocker& obstacle, const ConstraintSet& constraints) {
  // A handle is what moves, so it is named first.
  const std::string mover = NameOf(std::max(obstacle.first, obstacle.second), constraints);
  const bool is_alone = obstacle.first == obstacle.second;
  const std::string other = NameOf(std::min(obstacle.first, obstacle.second), constraints);
  if (!(obstacle.volume_ratio > 0)) {
    return absl::StrCat(mover, " would pass through ", is_alone ? "adjacent tissue" : other);
  }
  return absl::StrCat("the tissue ", is_alone ? "beside " : "between ", mover,
                      is_alone ? "" : absl::StrCat(" and ", other), " is squeezed to ",
                      absl::StrFormat("%.2g %% of its volume", 100 * obstacle.volume_ratio));
}

}  // namespace tissueform
