// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/mesh/mesh_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/report_parts.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string CountsText(const TetMeshFile& file, const MeshReport& report) {
  return absl::StrFormat(
      "  vertices           %10d\n"
      "  tets               %10d\n"
      "  boundary facets    %10d\n"
      "  boundary vertices  %10d\n"
      "  components         %10d\n"
      "  negative weights   %10d of %d edges (cotangent weights, one stiffness)\n"
      "  point arrays       %s\n"
      "  cell arrays        %s\n",
      report.num_vertices, report.num_tets, report.num_boundary_facets,
      report.num_boundary_vertices, report.num_components, report.num_negative_cotangent_weights,
      report.num_edges, ArraysText(file.point_data), ArraysText(file.cell_data));
}

std::string QualityText(const TetMeshFile& file, const TetQualitySummary& quality) {
  return absl::StrFormat(
      "  size               %10.4g mm (diagonal of the bounding box)\n"
      "  volume             %10.4g mm^3 (single tets %.3g to %.3g)\n"
      "  dihedral angles    %10.4g to %.4g degrees; tets below 5: %d, below 10: %d\n",
      file.mesh.BoundingBoxDiagonal(), quality.total_volume_mm3, quality.min_volume_mm3,
      quality.max_volume_mm3, quality.min_dihedral_deg, quality.max_dihedral_deg,
      quality.tets_below_5_deg, quality.tets_below_10_deg);
}

OrderedJson QualityJson(const TetQualitySummary& quality) {
  return {{"total_volume_mm3", quality.total_volume_mm3},
          {"min_volume_mm3", quality.min_volume_mm3},
          {"max_volume_mm3", quality.max_volume_mm3},
          {"min_dihedral_deg", quality.min_dihedral_deg},
          {"max_dihedral_deg", quality.max_dihedral_deg},
          {"tets_below_5_deg", quality.tets_below_5_deg},
          {"tets_below_10_deg", quality.tets_below_10_deg}};
}

}  // namespace

MeshReport ReportOfTets(const TetMeshFile& file) {
  MeshReport report = ValidateTetMesh(file.mesh, file.reoriented_tets, file.left_out_cells);
  AddImplausibleSize(file.mesh.positions(), &report.defects);
  return report;
}

std::string MeshReportText(const std::string& path, const TetMeshFile& file,
                           const MeshReport& report) {
  const bool is_finite = file.mesh.positions().allFinite();
  return absl::StrCat("mesh ", path, "\n", CountsText(file, report),
                      is_finite ? QualityText(file, report.quality) : "",
                      DefectsText(report.defects),
                      "verdict: ", report.usable() ? "usable" : "not usable", "\n");
}

OrderedJson MeshReportJson(const std::string& path, const TetMeshFile& file,
                           const MeshReport& report) {
  return {{"mesh", path},
          {"kind", "tets"},
          {"usable", report.usable()},
          {"vertices", report.num_vertices},
          {"tets", report.num_tets},
          {"boundary_facets", report.num_boundary_facets},
          {"boundary_vertices", report.num_boundary_vertices},
          {"components", report.num_components},
          {"edges", report.num_edges},
          {"negative_cotangent_weights", report.num_negative_cotangent_weights},
          {"quality", QualityJson(report.quality)},
          {"point_data", ArraysJson(file.point_data)},
          {"cell_data", ArraysJson(file.cell_data)},
          {"defects", DefectsJson(report.defects)}};
}

}  // namespace tissueform
