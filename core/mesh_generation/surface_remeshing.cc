// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_generation/surface_remeshing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include "core/base/status_macros.h"
#include "core/mesh/surface_validation.h"
#include "core/mesh_generation/surface_defects.h"
#include "core/mesh_generation/triangle_intersections.h"

namespace tissueform {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
using Face = Mesh::Face_index;
using Vertex = Mesh::Vertex_index;
using Tree =
    CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<Mesh>>>;
using Eigen::Vector3d;

// CGAL's remeshing takes one length for the faces that it is given. Lengths that change from place
// to place therefore go down in steps of this factor, each remeshed in its own pass. The last one
// is a hundredth of the full length.
constexpr double kLengthStep = 0.75;
constexpr int kMostSteps = 16;

// A repair makes edges this much shorter, this many edges round what intersects. A little more than
// a step shorter, so that rounding never leaves a length at its step, unless it is the last.
constexpr double kRepairFactor = 0.7;
constexpr double kRepairReach = 2;

Mesh ToCgal(const TriangleMesh& surface) {
  std::vector<Point> points;
  std::vector<std::array<size_t, 3>> polygons;
  for (const auto& p : surface.positions().rowwise()) points.emplace_back(p[0], p[1], p[2]);
  for (const auto& t : surface.triangles().rowwise()) {
    polygons.push_back(
        {static_cast<size_t>(t[0]), static_cast<size_t>(t[1]), static_cast<size_t>(t[2])});
  }
  // Gives every part its own vertex where several touch at one.
  PMP::orient_polygon_soup(points, polygons);
  Mesh mesh;
  PMP::polygon_soup_to_polygon_mesh(points, polygons, mesh);
  return mesh;
}

TriangleMesh FromCgal(const Mesh& mesh) {
  std::vector<int32_t> number(mesh.num_vertices() + mesh.number_of_removed_vertices());
  Positions positions(static_cast<Eigen::Index>(mesh.number_of_vertices()), 3);
  int32_t next = 0;
  for (const Vertex v : mesh.vertices()) {
    const Point& p = mesh.point(v);
    positions.row(next) << p.x(), p.y(), p.z();
    number[v.idx()] = next++;
  }
  TriangleIndices triangles(static_cast<Eigen::Index>(mesh.number_of_faces()), 3);
  Eigen::Index row = 0;
  for (const Face f : mesh.faces()) {
    int k = 0;
    for (const Vertex v : mesh.vertices_around_face(mesh.halfedge(f))) {
      triangles(row, k++) = number[v.idx()];
    }
    ++row;
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

double WantedLength(const RemeshingOptions& options, const Vector3d& place) {
  double length = options.edge_mm;
  for (const FineRegion& region : options.fine_regions) {
    const double outside = std::max(0.0, (place - region.centre_mm).norm() - region.radius_mm);
    length = std::min(length, region.edge_mm + options.growth * outside);
  }
  return length;
}

// 0 for the full length.
int StepOf(double length, double full_length) {
  const double steps = std::log(length / full_length) / std::log(kLengthStep);
  return std::clamp(static_cast<int>(std::lround(steps)), 0, kMostSteps);
}

Vector3d CentreOf(const Mesh& mesh, Face face) {
  Vector3d sum = Vector3d::Zero();
  for (const Vertex v : mesh.vertices_around_face(mesh.halfedge(face))) {
    const Point& p = mesh.point(v);
    sum += Vector3d(p.x(), p.y(), p.z());
  }
  return sum / 3;
}

// The surface while it changes, with the old one on which its vertices stay.
class Remesher {
 public:
  explicit Remesher(const TriangleMesh& surface)
      : old_(ToCgal(surface)), tree_(faces(old_).begin(), faces(old_).end(), old_), mesh_(old_) {
    tree_.build();
    tree_.accelerate_distance_queries();
  }

  const Mesh& mesh() const { return mesh_; }

  // As it was given, for another try.
  void BeginAnew() { mesh_ = old_; }

  // Gives every edge the length that is wanted where it lies: step by step, each in the faces that
  // are to be that fine, so that no part is ever coarser than it shall be.
  void Remesh(const RemeshingOptions& options) {
    int finest = 0;
    for (int step = 0; step <= finest; ++step) {
      // Chosen anew in every pass, since the one before has replaced the faces. A pass may show a
      // place that wants to be finer still, because its centres lie elsewhere: then `finest` grows.
      std::vector<Face> chosen;
      for (const Face f : mesh_.faces()) {
        const int wanted = StepOf(WantedLength(options, CentreOf(mesh_, f)), options.edge_mm);
        finest = std::max(finest, wanted);
        if (wanted == step) chosen.push_back(f);
      }
      RemeshFaces(chosen, options.edge_mm * std::pow(kLengthStep, step), options);
    }
  }

 private:
  void RemeshFaces(const std::vector<Face>& chosen, double length,
                   const RemeshingOptions& options) {
    if (chosen.empty()) return;
    auto is_feature = mesh_.add_property_map<Mesh::Edge_index, bool>("e:is_feature", false).first;
    if (options.feature_angle_deg > 0) {
      PMP::detect_sharp_edges(mesh_, options.feature_angle_deg, is_feature);
    }
    // Onto the surface as it was given, not as the last pass left it: distances do not add up.
    const auto onto_old = [this](Vertex v) { return tree_.closest_point(mesh_.point(v)); };
    PMP::isotropic_remeshing(chosen, length, mesh_,
                             CGAL::parameters::number_of_iterations(options.iterations)
                                 .number_of_relaxation_steps(options.relaxation_steps)
                                 .edge_is_constrained_map(is_feature)
                                 .projection_functor(onto_old));
    mesh_.remove_property_map(is_feature);
    mesh_.collect_garbage();
  }

  const Mesh old_;
  Tree tree_;
  Mesh mesh_;
};

absl::Status CheckOptions(const RemeshingOptions& options) {
  const auto is_length = [](double length) { return length > 0 && std::isfinite(length); };
  if (!is_length(options.edge_mm)) {
    return absl::InvalidArgumentError(
        absl::StrCat("edge length ", options.edge_mm, " mm is not above 0; give one in mm"));
  }
  for (const FineRegion& region : options.fine_regions) {
    if (is_length(region.edge_mm) && region.radius_mm >= 0) continue;
    return absl::InvalidArgumentError(absl::StrCat("a fine region has edge length ", region.edge_mm,
                                                   " mm and radius ", region.radius_mm,
                                                   " mm; give both in mm"));
  }
  return absl::OkStatus();
}

absl::Status CheckClosed(const TriangleMesh& surface) {
  SurfaceReport report = ValidateTriangleMesh(surface);
  // Triangles without area go away; the rest has to be right.
  for (const MeshDefect& defect : report.defects) {
    if (defect.kind == "open_edges" || defect.kind == "non_manifold_edges" ||
        defect.kind == "turned_triangles" || defect.kind == "non_finite_vertices") {
      return absl::InvalidArgumentError(
          absl::StrCat("the surface cannot be remeshed: ", defect.explanation));
    }
  }
  return absl::OkStatus();
}

// Triangles that go through others or have no area.
std::vector<Eigen::Index> BadTriangles(const TriangleMesh& mesh,
                                       const TriangleIntersections& intersections) {
  std::vector<Eigen::Index> bad = DegenerateTriangles(mesh);
  for (const auto& [a, b] : intersections.pairs) {
    bad.push_back(a);
    bad.push_back(b);
  }
  std::sort(bad.begin(), bad.end());
  bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
  return bad;
}

// The same options with shorter edges round the bad triangles.
RemeshingOptions FinerAround(const TriangleMesh& mesh, const std::vector<Eigen::Index>& bad,
                             const RemeshingOptions& options) {
  RemeshingOptions finer = options;
  for (const Eigen::Index f : bad) {
    Vector3d centre = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) centre += mesh.positions().row(mesh.triangles()(f, k)).transpose();
    centre /= 3;
    const double length = WantedLength(options, centre);
    finer.fine_regions.push_back({centre, kRepairReach * length, kRepairFactor * length});
  }
  return finer;
}

absl::StatusOr<RemeshedSurface> RemeshAndRepair(const TriangleMesh& surface,
                                                const RemeshingOptions& options) {
  RemeshingOptions current = options;
  std::vector<int64_t> repaired_pairs;
  Remesher remesher(surface);
  while (true) {
    // Always from the old surface: what has gone through itself once does not come apart again.
    remesher.BeginAnew();
    remesher.Remesh(current);
    TriangleMesh mesh = FromCgal(remesher.mesh());
    const TriangleIntersections intersections = FindTriangleIntersections(mesh);
    const std::vector<Eigen::Index> bad = BadTriangles(mesh, intersections);
    if (bad.empty()) return RemeshedSurface{std::move(mesh), std::move(repaired_pairs)};
    repaired_pairs.push_back(static_cast<int64_t>(intersections.pairs.size()));
    if (static_cast<int>(repaired_pairs.size()) > options.max_repairs) {
      return absl::InvalidArgumentError(
          absl::StrCat("the remeshed surface still has ", intersections.pairs.size(),
                       " pairs of triangles that go through each other after ", options.max_repairs,
                       " repairs; ask for shorter edges, or smooth the surface"));
    }
    current = FinerAround(mesh, bad, current);
  }
}

}  // namespace

absl::StatusOr<RemeshedSurface> RemeshSurface(const TriangleMesh& surface,
                                              const RemeshingOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(CheckClosed(surface));
  try {
    return RemeshAndRepair(surface, options);
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(
        absl::StrCat("CGAL gave up remeshing the surface (", exception.what(),
                     "); ask for other edge lengths, or smooth the surface"));
  }
}

}  // namespace tissueform
