// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/mesh/generation_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/mesh/mesh_report.h"
#include "client/cli/mesh/surface_report.h"
#include "client/cli/shared/report_parts.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string PairsText(const SurfaceDefects& defects) {
  return absl::StrCat(defects.num_intersecting_pairs, defects.found_all_pairs ? "" : " or more");
}

std::string SurfaceText(const GenerationReport& report) {
  const SurfaceReport& surface = report.defects.report;
  return absl::StrFormat(
      "surface %s\n"
      "  vertices           %10d\n"
      "  triangles          %10d\n"
      "  components         %10d\n"
      "  intersecting pairs %10s\n"
      "  enclosed volume    %10.4g mm^3 (0 if not closed)\n"
      "  coordinates        %s\n"
      "%s",
      report.surface, surface.num_vertices, surface.num_triangles, surface.num_components,
      PairsText(report.defects), surface.enclosed_volume_mm3, WordsOf(report.space).text,
      DefectsText(report.defects.defects));
}

std::string WrappingText(const GenerationReport& report) {
  if (!report.wrapped) return "";
  const WrappedSurface& wrap = *report.wrapped;
  std::string text = absl::StrFormat(
      "wrapped at %g mm (alpha %g mm)\n"
      "  triangles          %10d\n"
      "  wrap to surface    %10.3g mm at most\n"
      "  surface to wrap    %10.3g mm at most; %.1f %% is farther than 1.5 offsets (bridged gaps, "
      "inner walls)\n"
      "  enclosed volume    %10.4g mm^3\n",
      report.wrap_mm, kAlphaPerOffset * report.wrap_mm, wrap.mesh.num_triangles(),
      wrap.largest_to_surface_mm, wrap.largest_from_surface_mm, 100 * wrap.covered_fraction,
      wrap.volume_mm3);
  if (wrap.is_sheet) {
    absl::StrAppend(&text,
                    "  warning: the wrap went through an opening and follows both sides; close the "
                    "opening or use a larger --wrap-mm\n");
  }
  return text;
}

std::string RemeshingText(const GenerationReport& report) {
  if (!report.remeshed) return "";
  const RemeshedSurface& remeshed = *report.remeshed;
  std::string text = absl::StrFormat("remeshed to edges of %g mm\n  triangles          %10d\n",
                                     report.remesh_mm, remeshed.mesh.num_triangles());
  if (!remeshed.repaired_pairs.empty()) {
    absl::StrAppend(&text, "  repairs            intersecting pairs before each: ",
                    absl::StrJoin(remeshed.repaired_pairs, ", "), "\n");
  }
  return text;
}

OrderedJson SurfaceJson(const GenerationReport& report) {
  const SurfaceReport& surface = report.defects.report;
  return {{"file", report.surface},
          {"vertices", surface.num_vertices},
          {"triangles", surface.num_triangles},
          {"components", surface.num_components},
          {"enclosed_volume_mm3", surface.enclosed_volume_mm3},
          {"stated_space", WordsOf(report.space).json},
          {"intersecting_pairs", report.defects.num_intersecting_pairs},
          {"all_intersecting_pairs_found", report.defects.found_all_pairs},
          {"defects", DefectsJson(report.defects.defects)}};
}

OrderedJson WrappingJson(const GenerationReport& report) {
  if (!report.wrapped) return nullptr;
  const WrappedSurface& wrap = *report.wrapped;
  return {{"offset_mm", report.wrap_mm},
          {"alpha_mm", kAlphaPerOffset * report.wrap_mm},
          {"triangles", wrap.mesh.num_triangles()},
          {"largest_to_surface_mm", wrap.largest_to_surface_mm},
          {"largest_from_surface_mm", wrap.largest_from_surface_mm},
          {"covered_fraction", wrap.covered_fraction},
          {"enclosed_volume_mm3", wrap.volume_mm3},
          {"is_sheet", wrap.is_sheet}};
}

OrderedJson RemeshingJson(const GenerationReport& report) {
  if (!report.remeshed) return nullptr;
  return {{"edge_mm", report.remesh_mm},
          {"vertices", report.remeshed->mesh.num_vertices()},
          {"triangles", report.remeshed->mesh.num_triangles()},
          {"repaired_pairs", report.remeshed->repaired_pairs}};
}

}  // namespace

std::string GenerationReportText(const GenerationReport& report) {
  std::string text = absl::StrCat(SurfaceText(report), WrappingText(report), RemeshingText(report));
  if (!report.defect_file.empty()) {
    absl::StrAppend(&text, "triangles by defect  ", report.defect_file, "\n");
  }
  if (!report.made) return absl::StrCat(text, "verdict: not filled\n");
  return absl::StrCat(text, MeshReportText(report.mesh, *report.made, ReportOfTets(*report.made)));
}

OrderedJson GenerationReportJson(const GenerationReport& report) {
  OrderedJson json = {{"filled", report.made.has_value()},
                      {"surface", SurfaceJson(report)},
                      {"wrapping", WrappingJson(report)},
                      {"remeshing", RemeshingJson(report)},
                      {"defect_file", nullptr},
                      {"mesh", nullptr}};
  if (!report.defect_file.empty()) json["defect_file"] = report.defect_file;
  if (report.made) {
    json["mesh"] = MeshReportJson(report.mesh, *report.made, ReportOfTets(*report.made));
  }
  return json;
}

}  // namespace tissueform
