// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/mesh/surface_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/report_parts.h"

namespace tissueform {
namespace {

Eigen::Index CountOf(const SurfaceReport& report, std::string_view kind) {
  const MeshDefect* defect = report.Find(kind);
  return defect == nullptr ? 0 : defect->count;
}

const char* Verdict(const SurfaceReport& report) {
  if (!report.usable()) return "not usable";
  return report.is_closed() ? "usable, closed" : "usable as a surface, not closed";
}

}  // namespace

SpaceWords WordsOf(FileSpace space) {
  switch (space) {
    case FileSpace::kLps:
      return {"LPS, as the file states", "LPS"};
    case FileSpace::kRas:
      return {"LPS; the file states RAS: x and y were negated", "RAS"};
    case FileSpace::kUnstated:
      break;
  }
  return {"assumed to be LPS; the file states neither LPS nor RAS", ""};
}

std::string SurfaceReportText(const std::string& path, const TriangleMeshFile& file,
                              const SurfaceReport& report) {
  return absl::StrFormat(
      "surface %s\n"
      "  vertices           %10d\n"
      "  triangles          %10d\n"
      "  edges              %10d (open: %d, non-manifold: %d)\n"
      "  components         %10d\n"
      "  Euler number       %10d\n"
      "  area               %10.4g mm^2\n"
      "  enclosed volume    %10.4g mm^3 (0 if not closed)\n"
      "  coordinates        %s\n"
      "  point arrays       %s\n"
      "  cell arrays        %s\n"
      "%sverdict: %s\n",
      path, report.num_vertices, report.num_triangles, report.num_edges,
      CountOf(report, "open_edges"), CountOf(report, "non_manifold_edges"), report.num_components,
      report.euler_characteristic, report.area_mm2, report.enclosed_volume_mm3,
      WordsOf(file.space).text, ArraysText(file.point_data), ArraysText(file.cell_data),
      DefectsText(report.defects), Verdict(report));
}

nlohmann::ordered_json SurfaceReportJson(const std::string& path, const TriangleMeshFile& file,
                                         const SurfaceReport& report) {
  return {{"mesh", path},
          {"kind", "surface"},
          {"usable", report.usable()},
          {"closed", report.is_closed()},
          {"vertices", report.num_vertices},
          {"triangles", report.num_triangles},
          {"edges", report.num_edges},
          {"open_edges", CountOf(report, "open_edges")},
          {"non_manifold_edges", CountOf(report, "non_manifold_edges")},
          {"components", report.num_components},
          {"euler_characteristic", report.euler_characteristic},
          {"area_mm2", report.area_mm2},
          {"enclosed_volume_mm3", report.enclosed_volume_mm3},
          {"stated_space", WordsOf(file.space).json},
          {"point_data", ArraysJson(file.point_data)},
          {"cell_data", ArraysJson(file.cell_data)},
          {"defects", DefectsJson(report.defects)}};
}

}  // namespace tissueform
