// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/report_json.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/imaging/anatomy/skin_regions.h"
#include "core/planning/json_values.h"
#include "core/planning/plan_report/anatomy_json.h"
#include "core/planning/plan_report/cautions.h"
#include "core/planning/plan_report/coverage_report.h"
#include "core/planning/plan_report/input_words.h"
#include "core/planning/plan_report/labels_report.h"
#include "core/planning/plan_report/library_versions.h"
#include "core/planning/plan_report/lips_report.h"
#include "core/planning/plan_report/metal_report.h"
#include "core/planning/plan_report/mouth_report.h"
#include "core/planning/plan_report/values_report.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

Json ProgramJson(const std::string& program_version) {
  return {{"tissueform", program_version},
          {"itk", kItkVersion},
          {"cgal", kCgalVersion},
          {"vtk", kVtkVersion},
          {"tetgen", kTetgenVersion}};
}

Json SurfacesInputJson(const PlanBuild& build) {
  return {{"format", build.ct.format},       {"files", build.ct.num_files},
          {"surfaces", build.surface_roles}, {"surfaces_sha256", build.ct.sha256},
          {"size_voxels", build.ct_size},    {"spacing_mm", ToJson(build.ct_spacing_mm)},
          {"notes", build.ct.notes}};
}

Json InputJson(const PlanBuild& build) {
  if (!build.surface_roles.empty()) return SurfacesInputJson(build);
  return {{"format", build.ct.format},
          {"files", build.ct.num_files},
          {"ct_sha256", build.ct.sha256},
          {"recipe_sha256", build.recipe.sha256},
          {"size_voxels", build.ct_size},
          {"spacing_mm", ToJson(build.ct_spacing_mm)},
          {"gantry_tilt_deg", build.ct.gantry_tilt_deg},
          {"notes", build.ct.notes}};
}

Json HistogramJson(const Histogram& histogram) {
  return {{"low", histogram.low}, {"bin_width", histogram.bin_width}, {"counts", histogram.counts}};
}

Json MeshJson(const PlanBuild& build, const PlanMeasures& measures) {
  const SoftTissueMeshReport& report = build.mesh.report;
  return {{"vertices", build.mesh.mesh.num_vertices()},
          {"tets", build.mesh.mesh.num_tets()},
          {"boundary_vertices", build.mesh.surface.num_vertices()},
          {"boundary_triangles", build.mesh.surface.num_triangles()},
          {"components", measures.components},
          {"cavities", report.cavities},
          {"edge_mm", report.edge_mm},
          {"attempts", report.attempts},
          {"repaired_pairs", report.repaired_pairs},
          {"volume_mm3", report.quality.total_volume_mm3},
          {"ratio_to_voxel_volume", measures.ratio_to_voxels},
          {"ratio_to_isosurface_volume", report.volume_ratio},
          {"inverted_tets", measures.inverted_tets},
          {"smallest_tet_mm3", report.quality.min_volume_mm3},
          {"largest_tet_mm3", report.quality.max_volume_mm3},
          {"smallest_dihedral_deg", report.quality.min_dihedral_deg},
          {"largest_dihedral_deg", report.quality.max_dihedral_deg},
          {"tets_below_10_deg", report.quality.tets_below_10_deg},
          {"tets_below_5_deg", report.quality.tets_below_5_deg},
          {"tets_below_3_deg", report.tets_below_3_deg},
          {"share_over_3_deg", measures.share_over_3_deg},
          {"smallest_dihedral_histogram_deg", HistogramJson(DihedralHistogram(measures))}};
}

Json DistanceJson(const SurfaceDistances& distance) {
  return {{"mean_mm", distance.mean_mm}, {"p99_mm", distance.p99_mm}, {"max_mm", distance.max_mm}};
}

Json DistancesJson(const PlanBuild& build, const PlanMeasures& measures) {
  const SkinDistance& skin = build.skin_distance;
  return {{build.surface_roles.empty() ? "skin_to_ct" : "skin_to_surfaces",
           {{"vertices", skin.mm.size()},
            {"not_found", skin.not_found},
            {"mean_mm", skin.mean_mm},
            {"p99_mm", skin.p99_mm},
            {"max_mm", skin.max_mm},
            {"mean_voxels", measures.skin_mean_voxels},
            {"p99_voxels", measures.skin_p99_voxels},
            {"max_voxels", skin.max_mm / build.head.hu.geometry.spacing_mm},
            {"histogram_voxels", HistogramJson(SkinDistanceHistogram(measures))}}},
          {"boundary_to_isosurface", DistanceJson(build.mesh.report.to_isosurface)},
          {"isosurface_to_boundary", DistanceJson(build.mesh.report.from_isosurface)}};
}

Json StiffnessJson(const PlanBuild& build, const PlanMeasures& measures) {
  Json tissues = Json::array();
  for (size_t t = 0; t < build.recipe.tissues.size(); ++t) {
    const TissueClass& tissue = build.recipe.tissues[t];
    Json row = {{"name", tissue.name}, {"youngs_modulus_pa", tissue.youngs_modulus_pa}};
    if (tissue.factor_95 != 0) row["youngs_modulus_factor_95"] = tissue.factor_95;
    const bool has_next = t + 1 < build.recipe.tissues.size();
    if (has_next && build.surface_roles.empty()) row["hu_below"] = tissue.hu_below;
    row["tets"] = measures.tets_of_tissue[t];
    row["source"] = tissue.source;
    tissues.push_back(std::move(row));
  }
  return {{"poisson_ratio", build.recipe.poisson_ratio},
          {"tissues", tissues},
          {"tets_from_voxels", build.stiffness.from_voxels},
          {"tets_from_barycentre", build.stiffness.from_barycentre},
          {"tets_from_surroundings", build.stiffness.from_surroundings},
          {"tets_from_mixed_voxels", build.stiffness.from_mixed_voxels},
          {"tets_from_labels", build.stiffness.from_known_tissue}};
}

int64_t CountOf(const std::vector<uint8_t>& labels, size_t label) {
  return std::count(labels.begin(), labels.end(), static_cast<uint8_t>(label));
}

Json RegionsJson(const PlanBuild& build) {
  const PlanningRegions& regions = build.regions;
  Json handles = Json::object();
  for (size_t s = 0; s < build.segments.size(); ++s) {
    handles[build.segments[s].cut.name] = CountOf(regions.anatomy, kFirstSegment + s);
  }
  Json skin = Json::object();
  for (const SkinRegion region : kNamedSkinRegions) {
    skin[std::string(SkinRegionName(region))] =
        CountOf(regions.skin_region, static_cast<size_t>(region));
  }
  return {{"contact_band_mm", build.contact_band_mm},
          {"freed_by_contact", regions.freed_by_contact},
          {"free_vertices", CountOf(regions.anatomy, 0)},
          {"fixed_vertices", CountOf(regions.anatomy, kFixedBone)},
          {"handle_vertices", handles},
          {"vertices_on_bone",
           regions.bone.size() - std::count(regions.bone.begin(), regions.bone.end(), 0)},
          {"vertices_on_skin", std::count(regions.on_skin.begin(), regions.on_skin.end(), true)},
          {"skin_region_vertices", skin}};
}

Json QualityJson(const PlanBuild& build, const PlanMeasures& measures) {
  Json checks = Json::array();
  for (const QualityCheck& check : CheckQuality(build, measures)) {
    checks.push_back({{"requirement", check.name},
                      {"required", check.required},
                      {"measured", check.measured},
                      {"passed", check.passed}});
  }
  return checks;
}

Json PicturesJson(const std::vector<ReportPicture>& pictures) {
  Json list = Json::array();
  for (const ReportPicture& picture : pictures) {
    list.push_back({{"file", absl::StrCat("pictures/", picture.file)},
                    {"title", picture.title},
                    {"caption", picture.caption}});
  }
  return list;
}

}  // namespace

Json PlanReportJson(const PlanBuild& build, const PlanMeasures& measures,
                    const std::string& program_version,
                    const std::vector<ReportPicture>& pictures) {
  return {{"format", "tissueform-plan-report"},
          {"version", 1},
          {"notice", "research software, not a medical device"},
          {"coordinate_system", "LPS"},
          {"ready", AllPassed(CheckQuality(build, measures))},
          {"quality", QualityJson(build, measures)},
          {"cautions", Cautions(build)},
          {"program", ProgramJson(program_version)},
          {"input", InputJson(build)},
          {"values", ValuesJson(build)},
          {"metal", MetalJson(build)},
          {"labels", LabelsJson(build.labels)},
          {"head", HeadJson(build)},
          {"bone", BoneJson(build, measures)},
          {"landmarks", LandmarksJson(build)},
          {"segments", SegmentsJson(build)},
          {"region_of_interest", RegionJson(build)},
          {"soft_tissue", SoftTissueJson(build.soft_tissue)},
          {"lips", LipsJson(MeasureLipContact(build.soft_tissue.labels, build.landmarks),
                            build.lips.has_value())},
          {"mouth_line", MouthJson(build.mouth, build.landmarks)},
          {"lip_contact", LipContactJson(build.lips)},
          {"mesh", MeshJson(build, measures)},
          {"distances", DistancesJson(build, measures)},
          {"coverage", CoverageJson(build.coverage, WordsOf(build))},
          {"stiffness", StiffnessJson(build, measures)},
          {"regions", RegionsJson(build)},
          {"pictures", PicturesJson(pictures)},
          {"recipe", Json::parse(RecipeToJson(build.recipe))}};
}

}  // namespace tissueform
