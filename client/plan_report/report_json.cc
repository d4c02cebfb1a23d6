// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/plan_report/report_json.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/plan_report/cautions.h"
#include "client/plan_report/coverage_report.h"
#include "client/plan_report/library_versions.h"
#include "client/plan_report/lips_report.h"
#include "client/plan_report/metal_report.h"
#include "client/plan_report/objects_report.h"
#include "core/anatomy/skin_regions.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

Json PlaneJson(const Plane& plane) {
  return {{"point_mm", ToJson(plane.point_mm)}, {"normal", ToJson(plane.normal)}};
}

Json PlanesJson(const std::vector<Plane>& planes) {
  Json list = Json::array();
  for (const Plane& plane : planes) list.push_back(PlaneJson(plane));
  return list;
}

Json ProgramJson(const std::string& program_version) {
  return {{"tissueform", program_version},
          {"itk", kItkVersion},
          {"cgal", kCgalVersion},
          {"vtk", kVtkVersion},
          {"tetgen", kTetgenVersion}};
}

Json InputJson(const PlanBuild& build) {
  return {{"format", build.ct.format},
          {"files", build.ct.num_files},
          {"ct_sha256", build.ct.sha256},
          {"recipe_sha256", build.recipe.sha256},
          {"size_voxels", build.ct_size},
          {"spacing_mm", ToJson(build.ct_spacing_mm)},
          {"gantry_tilt_deg", build.ct.gantry_tilt_deg},
          {"notes", build.ct.notes}};
}

Json HeadJson(const PlanBuild& build) {
  const GridGeometry& grid = build.head.hu.geometry;
  return {{"spacing_mm", grid.spacing_mm},
          {"size_voxels", grid.size},
          {"origin_mm", ToJson(grid.origin_mm)},
          {"volume_mm3", static_cast<double>(CountVoxels(build.head.head)) * VoxelVolumeMm3(grid)},
          {"removed_mm3", build.head.removed_mm3},
          {"removed_means", "tissue that was taken away: tubes, cords, head rest"},
          {"removed_objects", ObjectsJson(build)},
          {"bare_fraction", build.head.bare_fraction},
          {"bare_means",
           "share of the outer surface nearer than 2.5 mm to bone; a living head has 0 to 0.1"}};
}

const char* SeparationText(JawSeparation separation) {
  switch (separation) {
    case JawSeparation::kThreshold:
      return "the teeth do not touch: at marker_hu the lower jaw is a piece of its own";
    case JawSeparation::kAutomaticCut:
      return "the teeth touch: cut apart by the plane between them with the best clearance";
    case JawSeparation::kGivenCut:
      break;
  }
  return "cut apart by the recipe's occlusal_plane";
}

Json BoneJson(const PlanBuild& build, const PlanMeasures& measures) {
  Json bone = {{"cranium_mm3", measures.bone_mm3[kCranium]},
               {"mandible_mm3", measures.bone_mm3[kMandible]},
               {"spine_mm3", measures.bone_mm3[kSpine]},
               {"separation", SeparationText(build.parts.separation)},
               {"marker_hu", build.parts.marker_hu}};
  if (build.parts.occlusal_plane) {
    bone["occlusal_plane"] = PlaneJson(*build.parts.occlusal_plane);
    bone["occlusal_clearance"] = build.parts.occlusal_clearance;
  }
  bone["confidence"] = build.parts.confidence;
  bone["confidence_means"] =
      "share of the lower jaw's surface that the CT itself shows, bone beside no bone; where the "
      "rest touches the cranium the watershed or the plane decided, and what lies within 3 mm of "
      "metal "
      "is not seen";
  return bone;
}

Json LandmarksJson(const Landmarks& landmarks) {
  Json json = {{"unit", "mm, LPS"}};
  for (const auto& [name, point] :
       {std::pair("menton", landmarks.menton),
        std::pair("pogonion", landmarks.pogonion),
        std::pair("lower_incisor", landmarks.lower_incisor),
        std::pair("upper_incisor", landmarks.upper_incisor),
        std::pair("lower_molar_left", landmarks.lower_molar.left),
        std::pair("lower_molar_right", landmarks.lower_molar.right),
        std::pair("upper_molar_left", landmarks.upper_molar.left),
        std::pair("upper_molar_right", landmarks.upper_molar.right),
        std::pair("last_upper_tooth", landmarks.last_upper_tooth),
        std::pair("ramus_front_left", landmarks.ramus_front.left),
        std::pair("ramus_front_right", landmarks.ramus_front.right),
        std::pair("gonion_left", landmarks.gonion.left),
        std::pair("gonion_right", landmarks.gonion.right),
        std::pair("condyle_left", landmarks.condyle.left),
        std::pair("condyle_right", landmarks.condyle.right),
        std::pair("nasal_floor", landmarks.nasal_floor),
        std::pair("nose_tip", landmarks.nose_tip),
        std::pair("subnasale", landmarks.subnasale),
        std::pair("upper_lip", landmarks.upper_lip),
        std::pair("lower_lip", landmarks.lower_lip),
        std::pair("skin_pogonion", landmarks.skin_pogonion),
        std::pair("mouth_corner_left", landmarks.mouth_corner.left),
        std::pair("mouth_corner_right", landmarks.mouth_corner.right)}) {
    json[name] = ToJson(point);
  }
  json["nose_prominence_mm"] = landmarks.nose_prominence_mm;
  for (const auto& [name, plane] : {std::pair("midsagittal_plane", landmarks.midsagittal),
                                    std::pair("lower_teeth_plane", landmarks.lower_teeth),
                                    std::pair("upper_teeth_plane", landmarks.upper_teeth),
                                    std::pair("occlusal_plane", landmarks.occlusal)}) {
    json[name] = PlaneJson(plane);
  }
  return json;
}

Json SegmentsJson(const PlanBuild& build) {
  Json segments = Json::array();
  for (size_t s = 0; s < build.segments.size(); ++s) {
    const BuiltSegment& segment = build.segments[s];
    const bool given = !build.recipe.segments[s].planes.empty();
    segments.push_back({{"name", segment.cut.name},
                        {"osteotomy", std::string(OsteotomyKindName(segment.cut.kind))},
                        {"volume_mm3", segment.volume_mm3},
                        {"pose", ToJson(segment.pose)},
                        {"largest_move_mm", segment.largest_move_mm},
                        {"planes_from", given ? "recipe" : "anatomy"},
                        {"planes", PlanesJson(segment.cut.planes)}});
  }
  return segments;
}

Json RegionJson(const PlanBuild& build) {
  const RegionOfInterest& region = build.soft_tissue.region;
  Json json = {{"back", PlaneJson(region.back)},
               {"above", PlaneJson(region.above)},
               {"below", PlaneJson(region.below)}};
  json["back"]["from"] = build.recipe.back ? "recipe" : "anatomy";
  json["above"]["from"] = build.recipe.above ? "recipe" : "anatomy";
  json["below"]["from"] = build.recipe.below ? "recipe" : "anatomy";
  return json;
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
  return {{"skin_to_ct",
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
    if (t + 1 < build.recipe.tissues.size()) row["hu_below"] = tissue.hu_below;
    row["tets"] = measures.tets_of_tissue[t];
    row["source"] = tissue.source;
    tissues.push_back(std::move(row));
  }
  return {{"poisson_ratio", build.recipe.poisson_ratio},
          {"tissues", tissues},
          {"tets_from_voxels", build.stiffness.from_voxels},
          {"tets_from_barycentre", build.stiffness.from_barycentre},
          {"tets_from_surroundings", build.stiffness.from_surroundings},
          {"tets_from_mixed_voxels", build.stiffness.from_mixed_voxels}};
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
          {"vertices_on_bone", std::count(regions.on_bone.begin(), regions.on_bone.end(), true)},
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
          {"metal", MetalJson(build)},
          {"head", HeadJson(build)},
          {"bone", BoneJson(build, measures)},
          {"landmarks", LandmarksJson(build.landmarks)},
          {"segments", SegmentsJson(build)},
          {"region_of_interest", RegionJson(build)},
          {"soft_tissue",
           {{"volume_mm3", build.soft_tissue.volume_mm3},
            {"left_out_mm3", build.soft_tissue.left_out_mm3},
            {"left_out_means",
             "soft voxels in the region's box that are not modelled: brain, "
             "marrow, thin sheets"},
            {"filled_mm3", build.soft_tissue.filled_mm3},
            {"filled_means",
             "modelled though it is no soft voxel: air or bone behind thin skin, small cavities"}}},
          {"lips", LipsJson(MeasureLipContact(build.soft_tissue.labels, build.landmarks))},
          {"mesh", MeshJson(build, measures)},
          {"distances", DistancesJson(build, measures)},
          {"coverage", CoverageJson(build.coverage)},
          {"stiffness", StiffnessJson(build, measures)},
          {"regions", RegionsJson(build)},
          {"pictures", PicturesJson(pictures)},
          {"recipe", Json::parse(RecipeToJson(build.recipe))}};
}

}  // namespace tissueform
