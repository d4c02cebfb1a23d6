// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/validation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"

#include "core/mesh/cotangent_weights.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/vertex_groups.h"

namespace tissueform {
namespace {

// A tet whose volume is this small against its longest edge cubed has no usable gradient in double
// precision.
constexpr double kDegenerateVolumeRatio = 1e-12;

// True when all vertices are finite.
bool FindNonFiniteVertices(const TetMesh& mesh, MeshReport* report) {
  std::vector<Eigen::Index> found;
  for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
    if (!mesh.positions().row(v).allFinite()) {
      found.push_back(v);
    }
  }
  AddDefect({"non_finite_vertices", Severity::kError, "vertices have NaN or infinite coordinates",
             "vertex", "rewrite the file from the program that made it"},
            found, &report->defects);
  return found.empty();
}

double LongestEdge(const TetMesh& mesh, Eigen::Index t) {
  double longest = 0;
  for (const auto& [p, q] : kTetEdges) {
    longest = std::max(
        longest,
        (mesh.positions().row(mesh.tets()(t, p)) - mesh.positions().row(mesh.tets()(t, q))).norm());
  }
  return longest;
}

void FindBadVolumes(const TetMesh& mesh, MeshReport* report) {
  const Eigen::VectorXd volumes = TetVolumes(mesh.positions(), mesh.tets());
  std::vector<Eigen::Index> degenerate;
  std::vector<Eigen::Index> inverted;
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    // Against the edge and not in mm^3: a mesh in other units has the same defects.
    const double smallest = kDegenerateVolumeRatio * std::pow(LongestEdge(mesh, t), 3);
    if (!(std::abs(volumes[t]) > smallest)) {  // also when numbers so large overflow
      degenerate.push_back(t);
    } else if (volumes[t] < 0) {
      inverted.push_back(t);
    }
  }
  AddDefect(
      {"degenerate_tets", Severity::kError, "tets have no volume", "tet", "remove or remesh them"},
      degenerate, &report->defects);
  AddDefect({"inverted_tets", Severity::kError, "tets have negative volume", "tet",
             "swap two vertices of each or remesh"},
            inverted, &report->defects);
}

// Cells with the same vertices as an earlier one, or groups of facets: sorted keys with the cell
// they come from.
template <size_t N>
using KeyedCells = std::vector<std::pair<std::array<int32_t, N>, Eigen::Index>>;

void FindDuplicateTets(const TetMesh& mesh, MeshReport* report) {
  KeyedCells<4> keys(mesh.num_tets());
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    std::copy_n(mesh.tets().row(t).data(), 4, keys[t].first.begin());
    std::sort(keys[t].first.begin(), keys[t].first.end());
    keys[t].second = t;
  }
  std::sort(keys.begin(), keys.end());
  std::vector<Eigen::Index> duplicates;
  for (size_t k = 1; k < keys.size(); ++k) {
    if (keys[k].first == keys[k - 1].first) {
      duplicates.push_back(keys[k].second);
    }
  }
  std::sort(duplicates.begin(), duplicates.end());
  AddDefect(
      {"duplicate_tets", Severity::kError, "tets repeat an earlier tet", "tet", "remove them"},
      duplicates, &report->defects);
}

void FindOversharedFacets(const TetMesh& mesh, MeshReport* report) {
  KeyedCells<3> keys;
  keys.reserve(4 * mesh.num_tets());
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    for (const auto& [a, b, c] : kTetFacets) {
      std::array<int32_t, 3> key = {mesh.tets()(t, a), mesh.tets()(t, b), mesh.tets()(t, c)};
      std::sort(key.begin(), key.end());
      keys.emplace_back(key, t);
    }
  }
  std::sort(keys.begin(), keys.end());
  std::vector<Eigen::Index> third_tets;
  for (size_t k = 2; k < keys.size(); ++k) {
    // Every facet counts once, at its third tet, however many more share it.
    const bool third = keys[k].first == keys[k - 2].first;
    const bool fourth = k >= 3 && keys[k].first == keys[k - 3].first;
    if (third && !fourth) {
      third_tets.push_back(keys[k].second);
    }
  }
  std::sort(third_tets.begin(), third_tets.end());
  AddDefect({"overshared_facets", Severity::kError, "facets belong to three or more tets", "tet",
             "the tets overlap; remesh"},
            third_tets, &report->defects);
}

void FindDuplicateVertices(const std::vector<int32_t>& first_at_place, MeshReport* report) {
  AddDefect({"duplicate_vertices", Severity::kWarning, "vertices lie exactly on an earlier one",
             "vertex", "tissue is not joined there; merge them unless that is meant"},
            DuplicateVertices(first_at_place), &report->defects);
}

// Facets are compared by the places of their corners: two of the boundary with the same places
// belong to different vertices, or they would be one inner facet.
void FindNonMatchingFacets(const TriangleIndices& boundary,
                           const std::vector<int32_t>& first_at_place, MeshReport* report) {
  KeyedCells<3> keys(boundary.rows());
  for (Eigen::Index f = 0; f < boundary.rows(); ++f) {
    for (int k = 0; k < 3; ++k) keys[f].first[k] = first_at_place[boundary(f, k)];
    std::sort(keys[f].first.begin(), keys[f].first.end());
    keys[f].second = boundary.row(f).minCoeff();
  }
  std::sort(keys.begin(), keys.end());
  std::vector<Eigen::Index> first_vertices;
  for (size_t k = 0; k < keys.size(); ++k) {
    const bool like_previous = k > 0 && keys[k].first == keys[k - 1].first;
    const bool like_next = k + 1 < keys.size() && keys[k].first == keys[k + 1].first;
    if (like_previous || like_next) first_vertices.push_back(keys[k].second);
  }
  std::sort(first_vertices.begin(), first_vertices.end());
  AddDefect({"non_matching_facets", Severity::kWarning,
             "boundary facets lie on another one without sharing its vertices", "at vertex",
             "the parts are not joined there; merge the vertices unless that is meant"},
            first_vertices, &report->defects);
}

void FindUnreferencedVertices(const ConnectedComponents& components, MeshReport* report) {
  AddDefect({"unreferenced_vertices", Severity::kWarning, "vertices belong to no tet", "vertex",
             "they stay where they are"},
            UnreferencedVertices(components.component_of_vertex), &report->defects);
}

void FindNonManifoldEdges(const TriangleIndices& boundary, MeshReport* report) {
  std::map<std::array<int32_t, 2>, int> facets_of_edge;
  for (Eigen::Index f = 0; f < boundary.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = boundary(f, k);
      const int32_t b = boundary(f, (k + 1) % 3);
      ++facets_of_edge[{std::min(a, b), std::max(a, b)}];
    }
  }
  std::vector<Eigen::Index> first_vertices;
  for (const auto& [edge, count] : facets_of_edge) {
    if (count != 2) {
      first_vertices.push_back(edge[0]);
    }
  }
  AddDefect(
      {"non_manifold_edges", Severity::kWarning, "boundary edges do not have two boundary facets",
       "vertex", "the surface touches itself there; deformation works, surface tools may not"},
      first_vertices, &report->defects);
}

void FindSeveralComponents(const ConnectedComponents& components, MeshReport* report) {
  if (components.count < 2) return;
  AddDefect({"several_components", Severity::kWarning, "connected components", "first vertices",
             "each needs a fixed or handle vertex"},
            FirstVertexOfComponents(components.component_of_vertex, components.count),
            &report->defects);
}

void ReportReorientation(Eigen::Index reoriented_tets, MeshReport* report) {
  if (reoriented_tets == 0) return;
  MeshDefect defect{"reoriented_tets", Severity::kWarning, reoriented_tets, {}, ""};
  defect.explanation =
      absl::StrCat(reoriented_tets,
                   " tets, all of the file, had negative volume and were turned by swapping their "
                   "last two vertices: the file counts corners the other way round");
  report->defects.push_back(std::move(defect));
}

void ReportLeftOutCells(Eigen::Index left_out_cells, MeshReport* report) {
  if (left_out_cells == 0) return;
  MeshDefect defect{"left_out_cells", Severity::kWarning, left_out_cells, {}, ""};
  defect.explanation = absl::StrCat(
      left_out_cells,
      " cells of the file are points, lines or faces: they were left out, with their values");
  report->defects.push_back(std::move(defect));
}

// What is measured at places, which must be finite.
void ValidatePlaces(const TetMesh& mesh, const TriangleIndices& boundary, MeshReport* report) {
  FindBadVolumes(mesh, report);
  const std::vector<int32_t> first_at_place = FirstVertexAtSamePlace(mesh.positions());
  FindDuplicateVertices(first_at_place, report);
  FindNonMatchingFacets(boundary, first_at_place, report);
  report->quality = SummarizeTetQuality(mesh);
  const CotangentWeightSigns signs = CountNegativeCotangentWeights(mesh);
  report->num_edges = signs.num_edges;
  report->num_negative_cotangent_weights = signs.num_negative;
}

}  // namespace

MeshReport ValidateTetMesh(const TetMesh& mesh, Eigen::Index reoriented_tets,
                           Eigen::Index left_out_cells) {
  MeshReport report;
  report.num_vertices = mesh.num_vertices();
  report.num_tets = mesh.num_tets();
  ReportReorientation(reoriented_tets, &report);
  ReportLeftOutCells(left_out_cells, &report);
  const TriangleIndices boundary = BoundaryFacets(mesh);
  if (FindNonFiniteVertices(mesh, &report)) ValidatePlaces(mesh, boundary, &report);
  FindDuplicateTets(mesh, &report);
  FindOversharedFacets(mesh, &report);

  const ConnectedComponents components = FindConnectedComponents(mesh.tets(), mesh.num_vertices());
  report.num_components = components.count;
  FindUnreferencedVertices(components, &report);
  FindSeveralComponents(components, &report);

  report.num_boundary_facets = boundary.rows();
  std::vector<int32_t> boundary_vertices(boundary.data(), boundary.data() + boundary.size());
  std::sort(boundary_vertices.begin(), boundary_vertices.end());
  report.num_boundary_vertices =
      std::unique(boundary_vertices.begin(), boundary_vertices.end()) - boundary_vertices.begin();
  FindNonManifoldEdges(boundary, &report);
  return report;
}

absl::Status CheckUsable(const MeshReport& report) { return CheckDefects(report.defects); }

absl::Status CheckTetMesh(const TetMesh& mesh) {
  MeshReport errors;
  if (FindNonFiniteVertices(mesh, &errors)) FindBadVolumes(mesh, &errors);
  FindDuplicateTets(mesh, &errors);
  FindOversharedFacets(mesh, &errors);
  return CheckUsable(errors);
}

}  // namespace tissueform
