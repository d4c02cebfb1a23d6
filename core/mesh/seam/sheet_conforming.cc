// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>
#include <utility>

#include "absl/status/status.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/mesh/seam/seam_sheet.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// A vertex is moved onto the sheet where that crosses an edge within this part of it.
constexpr double kNearVertex = 0.35;
// Moving may not make a tet worse than this, or than a part of what the worst about it was.
constexpr double kLeastShape = 0.12;
constexpr double kLeastOfShape = 0.6;

using Edge = std::pair<int32_t, int32_t>;  // rising
using Tet = std::array<int32_t, 4>;

// Where an edge crosses the sheet.
struct Crossing {
  Edge edge;
  double part = 0;  // of the way from the first to the second
  Eigen::Vector3d place;
};

// 1 for the regular tet, 0 for a flat one, negative when turned inside out.
double Shape(const std::array<Eigen::Vector3d, 4>& at) {
  const double six_volumes = (at[1] - at[0]).cross(at[2] - at[0]).dot(at[3] - at[0]);
  double squares = 0;
  for (const auto& [a, b] : kTetEdges) squares += (at[b] - at[a]).squaredNorm();
  const double edge = std::sqrt(squares / 6);
  return std::sqrt(2.0) * six_volumes / (edge * edge * edge);
}

class Conforming {
 public:
  Conforming(const TetMesh& mesh, Eigen::Index boundary_vertices, const SeamSheet& sheet)
      : sheet_(sheet), tets_of_(static_cast<size_t>(mesh.num_vertices())) {
    for (const auto& row : mesh.positions().rowwise()) AddVertex(row.transpose());
    for (Eigen::Index v = 0; v < boundary_vertices; ++v)
      on_boundary_[static_cast<size_t>(v)] = true;
    for (const auto& tet : mesh.tets().rowwise()) AddTet({tet[0], tet[1], tet[2], tet[3]});
    const TriangleIndices facets = BoundaryFacets(mesh);
    for (const auto& facet : facets.rowwise()) {
      for (int k = 0; k < 3; ++k) boundary_edges_.insert(std::minmax(facet[k], facet[(k + 1) % 3]));
    }
  }

  absl::StatusOr<SeamedMesh> Run() {
    MoveNearVertices();
    SplitCrossedEdges();
    if (num_moved_ + num_added_ == 0) {
      return absl::InvalidArgumentError("the seam meets no tissue; correct its line");
    }
    return Result();
  }

 private:
  void AddVertex(const Eigen::Vector3d& place) {
    const double height = sheet_.height(place);
    places_.push_back(place);
    on_boundary_.push_back(false);
    side_.push_back(height < 0 ? -1 : 1);
    if (tets_of_.size() < places_.size()) tets_of_.emplace_back();
  }
  void AddTet(const Tet& tet) {
    for (const int32_t v : tet) tets_of_[v].push_back(static_cast<int32_t>(tets_.size()));
    tets_.push_back(tet);
  }
  bool IsOnBoundary(const Edge& edge) const { return boundary_edges_.contains(edge); }

  // The place where the segment crosses the surface, by bisection: heights need not be linear.
  Crossing CrossingOf(const Edge& edge) const {
    const Eigen::Vector3d& from = places_[edge.first];
    const Eigen::Vector3d along = places_[edge.second] - from;
    double low = 0;
    double high = 1;
    for (int halving = 0; halving < 40; ++halving) {
      const double middle = (low + high) / 2;
      const bool is_low = (sheet_.height(from + middle * along) < 0) == (side_[edge.first] < 0);
      (is_low ? low : high) = middle;
    }
    const double part = (low + high) / 2;
    return {.edge = edge, .part = part, .place = from + part * along};
  }

  // Edges through the sheet, rising.
  std::vector<Crossing> Crossings() const {
    std::set<Edge> edges;
    for (const Tet& tet : tets_) {
      for (const auto& [a, b] : kTetEdges) {
        if (side_[tet[a]] * side_[tet[b]] < 0) edges.insert(std::minmax(tet[a], tet[b]));
      }
    }
    std::vector<Crossing> crossings;
    for (const Edge& edge : edges) {
      Crossing crossing = CrossingOf(edge);
      if (sheet_.holds(crossing.place)) crossings.push_back(std::move(crossing));
    }
    return crossings;
  }

  double WorstShape(int32_t vertex) const {
    double worst = std::numeric_limits<double>::infinity();
    for (const int32_t t : tets_of_[vertex]) {
      const Tet& tet = tets_[t];
      worst = std::min(worst,
                       Shape({places_[tet[0]], places_[tet[1]], places_[tet[2]], places_[tet[3]]}));
    }
    return worst;
  }

  void MoveIfSound(int32_t vertex, const Eigen::Vector3d& place) {
    const double before = WorstShape(vertex);
    const Eigen::Vector3d old = std::exchange(places_[vertex], place);
    if (WorstShape(vertex) < std::min(kLeastShape, kLeastOfShape * before)) {
      places_[vertex] = old;
      return;
    }
    side_[vertex] = 0;
    ++num_moved_;
  }

  // The nearest first, so that the result depends on no order of tets. A boundary keeps its shape
  // as far as its vertices stay on its edges.
  void MoveNearVertices() {
    std::vector<std::tuple<double, int32_t, Eigen::Vector3d>> moves;
    for (const Crossing& crossing : Crossings()) {
      const bool first = crossing.part < 0.5;
      const int32_t vertex = first ? crossing.edge.first : crossing.edge.second;
      const double part = first ? crossing.part : 1 - crossing.part;
      const bool may_move = !on_boundary_[vertex] || IsOnBoundary(crossing.edge);
      if (part < kNearVertex && may_move) moves.emplace_back(part, vertex, crossing.place);
    }
    std::stable_sort(moves.begin(), moves.end(), [](const auto& a, const auto& b) {
      return std::pair(std::get<0>(a), std::get<1>(a)) < std::pair(std::get<0>(b), std::get<1>(b));
    });
    for (const auto& [part, vertex, place] : moves) {
      if (side_[vertex] != 0) MoveIfSound(vertex, place);
    }
  }

  // Each child keeps one end of the edge, so every tet keeps a vertex beside the sheet,
  // and no new edge crosses it.
  void Split(const Crossing& crossing) {
    const auto added = static_cast<int32_t>(places_.size());
    const auto [a, b] = crossing.edge;
    AddVertex(crossing.place);
    side_.back() = 0;
    on_boundary_.back() = IsOnBoundary(crossing.edge);
    ++num_added_;
    const std::vector<int32_t> about = tets_of_[a];
    for (const int32_t t : about) {
      Tet& tet = tets_[t];
      if (std::find(tet.begin(), tet.end(), b) == tet.end()) continue;
      Tet other = tet;
      std::replace(tet.begin(), tet.end(), b, added);
      std::replace(other.begin(), other.end(), a, added);
      std::erase(tets_of_[b], t);
      tets_of_[added].push_back(t);
      AddTet(other);
    }
  }

  // The longest first, which keeps the children's shapes better.
  void SplitCrossedEdges() {
    std::vector<Crossing> crossings = Crossings();
    std::stable_sort(crossings.begin(), crossings.end(), [this](const auto& a, const auto& b) {
      return Length(a.edge) > Length(b.edge);
    });
    for (const Crossing& crossing : crossings) Split(crossing);
  }
  double Length(const Edge& edge) const {
    return (places_[edge.second] - places_[edge.first]).norm();
  }

  absl::StatusOr<SeamedMesh> Result() const {
    std::vector<int32_t> order(places_.size());
    for (size_t v = 0; v < order.size(); ++v) order[v] = static_cast<int32_t>(v);
    const auto inner = std::stable_partition(order.begin(), order.end(),
                                             [this](int32_t v) { return on_boundary_[v]; });
    Positions positions(static_cast<Eigen::Index>(places_.size()), 3);
    std::vector<int32_t> number(places_.size());
    std::vector<int8_t> side(places_.size());
    for (size_t k = 0; k < order.size(); ++k) {
      positions.row(static_cast<Eigen::Index>(k)) = places_[order[k]].transpose();
      number[order[k]] = static_cast<int32_t>(k);
      side[k] = side_[order[k]];
    }
    TetIndices tets(static_cast<Eigen::Index>(tets_.size()), 4);
    for (size_t t = 0; t < tets_.size(); ++t) {
      for (int k = 0; k < 4; ++k) tets(static_cast<Eigen::Index>(t), k) = number[tets_[t][k]];
    }
    TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(positions), std::move(tets)));
    return SeamedMesh{.mesh = std::move(mesh),
                      .boundary_vertices = inner - order.begin(),
                      .side = std::move(side),
                      .num_moved = num_moved_,
                      .num_added = num_added_};
  }

  const SeamSheet& sheet_;
  std::vector<Eigen::Vector3d> places_;
  std::vector<bool> on_boundary_;
  std::vector<int8_t> side_;
  std::vector<std::vector<int32_t>> tets_of_;
  std::vector<Tet> tets_;
  std::set<Edge> boundary_edges_;
  int64_t num_moved_ = 0;
  int64_t num_added_ = 0;
};

}  // namespace

absl::StatusOr<SeamedMesh> ConformToSheet(const TetMesh& mesh, Eigen::Index boundary_vertices,
                                          const SeamSheet& sheet) {
  return Conforming(mesh, boundary_vertices, sheet).Run();
}

}  // namespace tissueform
