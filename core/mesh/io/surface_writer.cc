// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/surface_writer.h"

#include <array>
#include <limits>
#include <sstream>
#include <vector>

#include "absl/strings/str_cat.h"
#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/PLY.h>
#include <CGAL/IO/STL.h>
#include <CGAL/Simple_cartesian.h>

#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

using Point = CGAL::Simple_cartesian<double>::Point_3;

struct Soup {
  std::vector<Point> points;
  std::vector<std::array<int32_t, 3>> triangles;
};

Soup ToSoup(const TriangleMesh& mesh) {
  Soup soup;
  for (const auto& p : mesh.positions().rowwise()) soup.points.emplace_back(p[0], p[1], p[2]);
  for (const auto& t : mesh.triangles().rowwise()) soup.triangles.push_back({t[0], t[1], t[2]});
  return soup;
}

// A binary STL begins with bytes that readers pass over.
constexpr size_t kStlHeaderBytes = 80;
constexpr char kStlNotice[] = "Tissueform, not a medical device: not for diagnosis or treatment";
// As 3D Slicer writes and reads it (file_space.h).
constexpr char kLpsMark[] = " SPACE=LPS";
static_assert(sizeof(kStlNotice) + sizeof(kLpsMark) <= kStlHeaderBytes);

std::string StlHeader(const std::string& mark) {
  std::string header = kStlNotice + mark;
  header.resize(kStlHeaderBytes, ' ');
  return header;
}

// As a comment where the format has them: behind the first line of OFF and the first two of PLY,
// which some readers take at their places.
std::string WithNotice(std::string contents, MeshFormat format, const std::string& mark) {
  const size_t first_line_end = contents.find('\n') + 1;
  switch (format) {
    case MeshFormat::kStl:
      return contents.replace(0, kStlHeaderBytes, StlHeader(mark));
    case MeshFormat::kPly:
      return contents.insert(contents.find('\n', first_line_end) + 1,
                             absl::StrCat("comment ", kNotMedicalDeviceNotice, mark, "\n"));
    case MeshFormat::kOff:
      return contents.insert(first_line_end,
                             absl::StrCat("# ", kNotMedicalDeviceNotice, mark, "\n"));
    default:
      return contents.insert(0, absl::StrCat("# ", kNotMedicalDeviceNotice, mark, "\n"));
  }
}

bool WriteSoup(const Soup& soup, MeshFormat format, std::ostream& stream) {
  const auto exactly =
      CGAL::parameters::stream_precision(std::numeric_limits<double>::max_digits10);
  switch (format) {
    case MeshFormat::kObj:
      return CGAL::IO::write_OBJ(stream, soup.points, soup.triangles, exactly);
    case MeshFormat::kOff:
      return CGAL::IO::write_OFF(stream, soup.points, soup.triangles, exactly);
    case MeshFormat::kStl:
      CGAL::IO::set_binary_mode(stream);
      return CGAL::IO::write_STL(stream, soup.points, soup.triangles);
    default:
      return CGAL::IO::write_PLY(stream, soup.points, soup.triangles, exactly);
  }
}

}  // namespace

absl::StatusOr<std::string> SurfaceFileContents(const TriangleMesh& mesh, MeshFormat format,
                                                bool states_lps) {
  std::ostringstream stream;
  if (!WriteSoup(ToSoup(mesh), format, stream)) {
    return absl::InternalError("CGAL cannot write the surface");
  }
  return WithNotice(stream.str(), format, states_lps ? kLpsMark : "");
}

}  // namespace tissueform
