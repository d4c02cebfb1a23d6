// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_generation/remeshing_passes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include "core/base/parallel_for.h"

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

// Four slabs of a face keep two threads evenly busy, and their seams are short beside them. A small
// surface is done before its seams would be.
constexpr int kSlabs = 4;
constexpr Eigen::Index kFewTriangles = 40000;
// In edges of the full length: what lies so near to a seam is left to the seam's own pass, in which
// so much on either side is remeshed, again as far as it was.
constexpr double kSeam = 0.5;
constexpr double kReachOfSeam = 2;

struct Soup {
  std::vector<Point> points;
  std::vector<std::array<size_t, 3>> triangles;
};

Mesh ToCgal(Soup soup) {
  // Gives every part its own vertex where several touch at one.
  PMP::orient_polygon_soup(soup.points, soup.triangles);
  Mesh mesh;
  PMP::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
  return mesh;
}

// The triangles for which `chosen` holds.
Soup SoupOf(const TriangleMesh& surface, const std::function<bool(Eigen::Index)>& chosen) {
  Soup soup;
  std::vector<size_t> number(static_cast<size_t>(surface.num_vertices()),
                             std::numeric_limits<size_t>::max());
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    if (!chosen(f)) continue;
    std::array<size_t, 3> triangle{};
    for (int k = 0; k < 3; ++k) {
      const int32_t v = surface.triangles()(f, k);
      if (number[v] == std::numeric_limits<size_t>::max()) {
        number[v] = soup.points.size();
        const auto p = surface.positions().row(v);
        soup.points.emplace_back(p[0], p[1], p[2]);
      }
      triangle[k] = number[v];
    }
    soup.triangles.push_back(triangle);
  }
  return soup;
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

// Slabs put together again at the vertices of their borders, which remeshing has left alone.
Mesh Joined(const std::vector<Mesh>& slabs) {
  Soup soup;
  std::map<std::array<double, 3>, size_t> on_border;
  for (const Mesh& slab : slabs) {
    std::vector<size_t> number(slab.num_vertices());
    for (const Vertex v : slab.vertices()) {
      const Point& p = slab.point(v);
      size_t own = soup.points.size();
      if (slab.is_border(v)) own = on_border.try_emplace({p.x(), p.y(), p.z()}, own).first->second;
      if (own == soup.points.size()) soup.points.push_back(p);
      number[v.idx()] = own;
    }
    for (const Face f : slab.faces()) {
      std::array<size_t, 3> triangle{};
      int k = 0;
      for (const Vertex v : slab.vertices_around_face(slab.halfedge(f))) {
        triangle[k++] = number[v.idx()];
      }
      soup.triangles.push_back(triangle);
    }
  }
  return ToCgal(std::move(soup));
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

Vector3d CentreOf(const TriangleMesh& mesh, Eigen::Index f) {
  Vector3d sum = Vector3d::Zero();
  for (const int32_t v : mesh.triangles().row(f)) sum += mesh.positions().row(v).transpose();
  return sum / 3;
}

void RemeshFaces(const std::vector<Face>& chosen, double length, const RemeshingOptions& options,
                 const Tree& old_surface, Mesh* mesh) {
  if (chosen.empty()) return;
  auto is_feature = mesh->add_property_map<Mesh::Edge_index, bool>("e:is_feature", false).first;
  if (options.feature_angle_deg > 0) {
    PMP::detect_sharp_edges(*mesh, options.feature_angle_deg, is_feature);
  }
  // Onto the surface as it was given, not as the last pass left it: distances do not add up.
  const auto onto_old = [&](Vertex v) { return old_surface.closest_point(mesh->point(v)); };
  PMP::isotropic_remeshing(chosen, length, *mesh,
                           CGAL::parameters::number_of_iterations(options.iterations)
                               .number_of_relaxation_steps(options.relaxation_steps)
                               .edge_is_constrained_map(is_feature)
                               .projection_functor(onto_old));
  mesh->remove_property_map(is_feature);
  mesh->collect_garbage();
}

// Gives every edge the length that is wanted where it lies: step by step, each in the faces that
// are to be that fine, so that no part is ever coarser than it shall be. Faces for whose centre
// `within` does not hold stay.
void RemeshWhere(const std::function<bool(const Vector3d&)>& within,
                 const RemeshingOptions& options, const Tree& old_surface, Mesh* mesh) {
  int finest = 0;
  for (int step = 0; step <= finest; ++step) {
    // Chosen anew in every pass, since the one before has replaced the faces. A pass may show a
    // place that wants to be finer still, because its centres lie elsewhere: then `finest` grows.
    std::vector<Face> chosen;
    for (const Face f : mesh->faces()) {
      const Vector3d centre = CentreOf(*mesh, f);
      if (!within(centre)) continue;
      const int wanted = StepOf(WantedLength(options, centre), options.edge_mm);
      finest = std::max(finest, wanted);
      if (wanted == step) chosen.push_back(f);
    }
    RemeshFaces(chosen, options.edge_mm * std::pow(kLengthStep, step), options, old_surface, mesh);
  }
}

// Faces whose centres lie between two places along the axis; infinite at the ends.
struct Slab {
  double from = 0;
  double to = 0;
  Mesh start;
  Mesh done;
  bool is_done = false;
};

// How far from its centre a fine region makes edges shorter than the full length, and a little for
// the edges that then reach out of it.
double ReachOf(const FineRegion& region, const RemeshingOptions& options) {
  return region.radius_mm + std::max(0.0, options.edge_mm - region.edge_mm) / options.growth +
         2 * options.edge_mm;
}

}  // namespace

double WantedLength(const RemeshingOptions& options, const Vector3d& place) {
  double length = options.edge_mm;
  for (const FineRegion& region : options.fine_regions) {
    const double outside = std::max(0.0, (place - region.centre_mm).norm() - region.radius_mm);
    length = std::min(length, region.edge_mm + options.growth * outside);
  }
  return length;
}

struct RemeshingPasses::State {
  explicit State(const TriangleMesh& surface)
      : old_surface(ToCgal(SoupOf(surface, [](Eigen::Index) { return true; }))),
        tree(faces(old_surface).begin(), faces(old_surface).end(), old_surface) {
    tree.build();
    tree.accelerate_distance_queries();
    // What the tree makes when it is first asked is made before threads ask it.
    tree.closest_point(old_surface.point(*old_surface.vertices().begin()));
    if (surface.num_triangles() > kFewTriangles) CutIntoSlabs(surface);
  }

  // Across the longest side of the surface's box, with as many faces in each.
  void CutIntoSlabs(const TriangleMesh& surface) {
    (surface.positions().colwise().maxCoeff() - surface.positions().colwise().minCoeff())
        .maxCoeff(&axis);
    std::vector<double> places(static_cast<size_t>(surface.num_triangles()));
    for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
      places[static_cast<size_t>(f)] = CentreOf(surface, f)[axis];
    }
    std::vector<double> rising = places;
    std::sort(rising.begin(), rising.end());
    constexpr double kFar = std::numeric_limits<double>::infinity();
    for (size_t s = 0; s < kSlabs; ++s) {
      Slab slab;
      slab.from = s == 0 ? -kFar : slabs.back().to;
      slab.to = s + 1 == kSlabs ? kFar : rising[rising.size() * (s + 1) / kSlabs];
      slab.start = ToCgal(SoupOf(surface, [&](Eigen::Index f) {
        const double place = places[static_cast<size_t>(f)];
        return slab.from <= place && place < slab.to;
      }));
      slabs.push_back(std::move(slab));
    }
  }

  bool Reaches(const FineRegion& region, const Slab& slab, const RemeshingOptions& options) const {
    const double reach = ReachOf(region, options);
    return region.centre_mm[axis] + reach > slab.from && region.centre_mm[axis] - reach < slab.to;
  }

  void RemeshSlab(const RemeshingOptions& options, Slab* slab) const {
    const double left_out = kSeam * options.edge_mm;
    slab->done = slab->start;
    RemeshWhere(
        [&](const Vector3d& centre) {
          return slab->from + left_out < centre[axis] && centre[axis] < slab->to - left_out;
        },
        options, tree, &slab->done);
    slab->is_done = true;
  }

  // Those that a fine region which was not there before reaches.
  void RemeshSlabs(const RemeshingOptions& options) {
    std::vector<Slab*> changed;
    for (Slab& slab : slabs) {
      const bool reached =
          std::any_of(options.fine_regions.begin() + static_cast<int64_t>(known_regions),
                      options.fine_regions.end(),
                      [&](const FineRegion& region) { return Reaches(region, slab, options); });
      if (reached || !slab.is_done) changed.push_back(&slab);
    }
    known_regions = options.fine_regions.size();
    std::vector<std::exception_ptr> thrown(changed.size());
    ParallelFor(options.threads, static_cast<Eigen::Index>(changed.size()), 1,
                [&](Eigen::Index begin, Eigen::Index end) {
                  for (Eigen::Index i = begin; i < end; ++i) {
                    try {
                      RemeshSlab(options, changed[static_cast<size_t>(i)]);
                    } catch (...) {
                      thrown[static_cast<size_t>(i)] = std::current_exception();
                    }
                  }
                });
    for (const std::exception_ptr& exception : thrown) {
      if (exception) std::rethrow_exception(exception);
    }
  }

  Mesh RemeshInSlabs(const RemeshingOptions& options) {
    RemeshSlabs(options);
    std::vector<Mesh> parts;
    for (const Slab& slab : slabs) parts.push_back(slab.done);
    Mesh mesh = Joined(parts);
    RemeshWhere(
        [&](const Vector3d& centre) {
          return std::any_of(slabs.begin(), slabs.end() - 1, [&](const Slab& slab) {
            return std::abs(centre[axis] - slab.to) < kReachOfSeam * options.edge_mm;
          });
        },
        options, tree, &mesh);
    return mesh;
  }

  const Mesh old_surface;
  Tree tree;
  Eigen::Index axis = 0;
  std::vector<Slab> slabs;  // none: the surface is small
  size_t known_regions = 0;
};

RemeshingPasses::RemeshingPasses(const TriangleMesh& surface)
    : state_(std::make_unique<State>(surface)) {}

RemeshingPasses::~RemeshingPasses() = default;

TriangleMesh RemeshingPasses::Remesh(const RemeshingOptions& options) {
  // Edges that stay in place run on from slab to slab.
  if (!state_->slabs.empty() && options.feature_angle_deg <= 0) {
    return FromCgal(state_->RemeshInSlabs(options));
  }
  Mesh mesh = state_->old_surface;
  RemeshWhere([](const Vector3d&) { return true; }, options, state_->tree, &mesh);
  return FromCgal(mesh);
}

}  // namespace tissueform
