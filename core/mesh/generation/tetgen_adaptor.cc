// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/tetgen_adaptor.h"

#include <algorithm>
#include <string>
#include <tetgen.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

// TetGen's switches; its defaults are not all quiet. p fills a surface, Q is quiet, q the quality,
// Y keeps the surface, a bounds volumes (without a number: of the regions), A numbers the tets of
// regions, m takes the lengths at the vertices.
std::string Switches(const TetrahedralizationOptions& options) {
  std::string switches =
      absl::StrFormat("pQq%.6f/%.6f", options.max_radius_edge_ratio, options.min_dihedral_deg);
  if (options.keep_surface) absl::StrAppend(&switches, "Y");
  if (options.max_tet_volume_mm3 > 0) {
    absl::StrAppendFormat(&switches, "a%.12f", options.max_tet_volume_mm3);
  }
  if (!options.regions.empty()) absl::StrAppend(&switches, "aA");
  if (!options.edge_lengths_mm.empty()) absl::StrAppend(&switches, "m");
  return switches;
}

// TetGen frees what it finds with delete[].
template <typename T>
T* NewArray(size_t size) {
  return new T[size]();
}

void CopyPoints(const TriangleMesh& surface, const std::vector<double>& edge_lengths_mm,
                tetgenio* io) {
  io->numberofpoints = static_cast<int>(surface.num_vertices());
  io->pointlist = NewArray<double>(static_cast<size_t>(surface.positions().size()));
  std::copy_n(surface.positions().data(), surface.positions().size(), io->pointlist);
  if (edge_lengths_mm.empty()) return;
  io->numberofpointmtrs = 1;
  io->pointmtrlist = NewArray<double>(edge_lengths_mm.size());
  std::copy(edge_lengths_mm.begin(), edge_lengths_mm.end(), io->pointmtrlist);
}

void CopyTriangles(const TriangleIndices& triangles, tetgenio* io) {
  io->numberoffacets = static_cast<int>(triangles.rows());
  io->facetlist = NewArray<tetgenio::facet>(static_cast<size_t>(triangles.rows()));
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    tetgenio::facet& facet = io->facetlist[f];
    facet.numberofpolygons = 1;
    facet.polygonlist = NewArray<tetgenio::polygon>(1);
    facet.polygonlist->numberofvertices = 3;
    facet.polygonlist->vertexlist = NewArray<int>(3);
    std::copy_n(triangles.row(f).data(), 3, facet.polygonlist->vertexlist);
  }
}

void CopyHoles(const std::vector<Eigen::Vector3d>& holes_mm, tetgenio* io) {
  io->numberofholes = static_cast<int>(holes_mm.size());
  if (holes_mm.empty()) return;
  io->holelist = NewArray<double>(3 * holes_mm.size());
  for (size_t h = 0; h < holes_mm.size(); ++h)
    std::copy_n(holes_mm[h].data(), 3, io->holelist + 3 * h);
}

void CopyRegions(const std::vector<MeshRegion>& regions, tetgenio* io) {
  io->numberofregions = static_cast<int>(regions.size());
  if (regions.empty()) return;
  io->regionlist = NewArray<double>(5 * regions.size());
  for (size_t r = 0; r < regions.size(); ++r) {
    double* row = io->regionlist + 5 * r;
    std::copy_n(regions[r].point_mm.data(), 3, row);
    row[3] = regions[r].attribute;
    row[4] = regions[r].max_tet_volume_mm3 > 0 ? regions[r].max_tet_volume_mm3 : -1;
  }
}

// What the numbers mean that TetGen throws.
absl::Status ExplainThrown(int code) {
  switch (code) {
    case 1:
      return absl::ResourceExhaustedError(
          "TetGen is out of memory; allow more memory or larger tets");
    case 3:
      return absl::InvalidArgumentError("TetGen finds intersecting triangles; remesh the surface");
    case 4:
    case 5:
      return absl::InvalidArgumentError(
          "TetGen finds parts that are too close to each other; remesh the surface coarser");
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("TetGen gives up (its code ", code, "); remesh the surface"));
  }
}

}  // namespace

absl::StatusOr<RawTets> RunTetgen(const TriangleMesh& surface,
                                  const std::vector<Eigen::Vector3d>& holes_mm,
                                  const TetrahedralizationOptions& options) {
  tetgenio in;
  tetgenio out;
  CopyPoints(surface, options.edge_lengths_mm, &in);
  CopyTriangles(surface.triangles(), &in);
  CopyHoles(holes_mm, &in);
  CopyRegions(options.regions, &in);
  std::string switches = Switches(options);
  tetgenbehavior behavior;
  if (!behavior.parse_commandline(switches.data())) {
    return absl::InternalError(absl::StrCat("TetGen does not know its switches ", switches));
  }
  try {
    tetrahedralize(&behavior, &in, &out);
  } catch (int code) {
    return ExplainThrown(code);
  }
  if (out.tetrahedronlist == nullptr || out.numberoftetrahedra == 0) {
    return absl::InvalidArgumentError("TetGen ends without tets; remesh the surface");
  }
  RawTets raw;
  raw.positions = Eigen::Map<const Positions>(out.pointlist, out.numberofpoints, 3);
  raw.tets = Eigen::Map<const TetIndices>(out.tetrahedronlist, out.numberoftetrahedra, 4);
  if (out.numberoftetrahedronattributes > 0) {
    raw.attributes = Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<>>(
        out.tetrahedronattributelist, out.numberoftetrahedra,
        Eigen::InnerStride<>(out.numberoftetrahedronattributes));
  }
  return raw;
}

}  // namespace tissueform
