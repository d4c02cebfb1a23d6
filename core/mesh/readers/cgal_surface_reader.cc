// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/cgal_surface_reader.h"

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/Simple_cartesian.h>

#include "core/base/status_macros.h"
#include "core/mesh/readers/polygon_fan.h"

namespace tissueform {
namespace {

using Point = CGAL::Simple_cartesian<double>::Point_3;

// Without the zero bytes that ZBrush leaves at the end, which CGAL takes for an unknown line.
std::string TextOf(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  text.resize(text.find_last_not_of('\0') + 1);
  return text;
}

}  // namespace

absl::StatusOr<RawMesh> ReadCgalSurface(const CheckedMeshFile& file) {
  std::istringstream stream(TextOf(file.path));
  std::vector<Point> points;
  std::vector<std::vector<int64_t>> polygons;
  const bool read = file.format == MeshFormat::kObj ? CGAL::IO::read_OBJ(stream, points, polygons)
                                                    : CGAL::IO::read_OFF(stream, points, polygons);
  if (!read) {
    return absl::InvalidArgumentError(
        "it is damaged: a line is not as the format wants it, a number is missing or a face refers "
        "to a vertex that is not there");
  }
  RawMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (size_t v = 0; v < points.size(); ++v) {
    mesh.positions.row(static_cast<Eigen::Index>(v)) << points[v].x(), points[v].y(), points[v].z();
  }
  PolygonFan fan;
  for (const std::vector<int64_t>& polygon : polygons) TF_RETURN_IF_ERROR(fan.Add(polygon));
  mesh.cells = fan.Triangles();
  mesh.split_polygons = fan.split_polygons();
  return mesh;
}

}  // namespace tissueform
