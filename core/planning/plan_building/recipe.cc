// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/recipe.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_schema.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/json_values.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_building/recipe_markups.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

const JsonSchema& RecipeSchema() {
  static const JsonSchema* const schema = new JsonSchema(RecipeSchemaText());
  return *schema;
}

// What follows reads a text that has passed the schema: keys and types are as they must be.

absl::StatusOr<Plane> ToPlane(const Json& json, const std::string& where) {
  Plane plane{VectorFromJson(json.at("point_mm")), VectorFromJson(json.at("normal"))};
  const double length = plane.normal.norm();
  if (!(length > 1e-6)) {
    return absl::InvalidArgumentError(absl::StrCat("the normal at ", where, " has no length"));
  }
  plane.normal /= length;
  return plane;
}

absl::Status ReadPlane(const Json& json, const char* key, const std::string& where,
                       std::optional<Plane>* plane) {
  if (!json.contains(key)) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(*plane, ToPlane(json.at(key), absl::StrCat(where, "/", key)));
  return absl::OkStatus();
}

void ReadValues(const Json& json, CtReadOptions* options) {
  const std::string values = json.value("values", "auto");
  options->values = values == "hu"     ? CtValues::kHu
                    : values == "gray" ? CtValues::kGray
                                       : CtValues::kAuto;
  const auto threshold = [&json](const char* key, std::optional<double>& gray) {
    if (json.contains(key)) gray = json.at(key).get<double>();
  };
  threshold("tissue_above_gray", options->tissue_above_gray);
  threshold("bone_above_gray", options->bone_above_gray);
}

CtReadOptions ToCtOptions(const Json& json) {
  CtReadOptions options;
  ReadValues(json, &options);
  if (json.contains("hu_offset")) options.hu_offset = json.at("hu_offset").get<double>();
  options.axes = json.value("axes", "");
  if (json.contains("series_number")) options.series_number = json.at("series_number").get<int>();
  const std::string join = json.value("join_series", "auto");
  options.join_series = join == "always"  ? JoinSeries::kAlways
                        : join == "never" ? JoinSeries::kNever
                                          : JoinSeries::kAuto;
  return options;
}

absl::StatusOr<RecipeLabels> ToLabels(const Json& json, const std::string& folder) {
  RecipeLabels labels;
  labels.file = json.value("file", "");
  if (!labels.file.empty()) labels.file = (std::filesystem::path(folder) / labels.file).string();
  labels.convention = json.value("convention", "");
  const Json all_names = json.value("names", Json::object());
  for (const auto& [key, names] : all_names.items()) {
    const std::optional<Structure> structure = StructureOfKey(key);
    if (!structure) {
      return absl::InvalidArgumentError(
          absl::StrCat("unknown structure at /labels/names; use ", StructureKeys()));
    }
    for (const Json& name : names) {
      LabelRule rule{.structure = *structure, .name = {}, .value = {}};
      if (name.is_string()) rule.name = name.get<std::string>();
      if (name.is_number()) rule.value = name.get<int>();
      labels.names.push_back(std::move(rule));
    }
  }
  return labels;
}

MetalOptions ToMetal(const Json& json) {
  MetalOptions options;
  options.correct = json != "off";
  if (json.is_number()) options.threshold_hu = json.get<double>();
  return options;
}

HeadSegmentationOptions ToSegmentation(const Json& json) {
  HeadSegmentationOptions options;
  const auto threshold = [&json](const char* key, int16_t& hu) {
    hu = static_cast<int16_t>(std::lround(json.value(key, static_cast<double>(hu))));
  };
  threshold("tissue_above_hu", options.tissue_above_hu);
  threshold("bone_above_hu", options.bone_above_hu);
  options.opening_radius_mm = json.value("opening_radius_mm", options.opening_radius_mm);
  options.smallest_bone_mm3 = json.value("smallest_bone_mm3", options.smallest_bone_mm3);
  return options;
}

OsteotomyKind ToKind(const std::string& name) {
  for (const OsteotomyKind kind : {OsteotomyKind::kBssro, OsteotomyKind::kLeFort1}) {
    if (name == OsteotomyKindName(kind)) return kind;
  }
  return OsteotomyKind::kGenioplasty;
}

// Where the piece and its movement come from, if not from osteotomy, planes and pose.
absl::Status ReadSegmentSources(const Json& json, const std::string& where,
                                const std::string& folder, RecipeSegment* segment) {
  if (!json.contains("osteotomy") && !json.contains("surface")) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the segment at ", where, " has no \"osteotomy\" and no \"surface\"; give one of them"));
  }
  if (json.contains("surface") && json.contains("planes")) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"planes\" at ", where, " has no use beside \"surface\""));
  }
  if (json.contains("surface")) segment->surface = SurfaceFromJson(json.at("surface"), folder);
  TF_ASSIGN_OR_RETURN(segment->move, MoveSourceFromJson(json, where, folder));
  return absl::OkStatus();
}

absl::StatusOr<RecipeSegment> ToSegment(const Json& json, const std::string& where,
                                        const std::string& folder) {
  RecipeSegment segment;
  segment.name = json.at("name");
  TF_RETURN_IF_ERROR(ReadSegmentSources(json, where, folder, &segment));
  segment.kind_given = json.contains("osteotomy");
  segment.kind = ToKind(json.value("osteotomy", "bssro"));
  const Json planes = json.value("planes", Json::array());
  for (size_t i = 0; i < planes.size(); ++i) {
    TF_ASSIGN_OR_RETURN(Plane plane, ToPlane(planes[i], absl::StrCat(where, "/planes/", i)));
    segment.planes.push_back(std::move(plane));
  }
  segment.pose = PoseFromJson(json.value("pose", Json::object()));
  segment.dissected_mm = json.value("dissected_mm", segment.dissected_mm);
  return segment;
}

absl::Status ReadSegments(const Json& json, const std::string& folder, Recipe* recipe) {
  std::set<std::string> names;
  for (size_t i = 0; i < json.size(); ++i) {
    const std::string where = absl::StrCat("/segments/", i);
    TF_ASSIGN_OR_RETURN(RecipeSegment segment, ToSegment(json[i], where, folder));
    if (!names.insert(segment.name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("two segments are named \"", segment.name, "\" (", where, "/name)"));
    }
    recipe->segments.push_back(std::move(segment));
  }
  return absl::OkStatus();
}

SoftTissueOptions ToSoftTissue(const Json& json) {
  SoftTissueOptions options;
  options.thinnest_mm = json.value("thinnest_mm", options.thinnest_mm);
  options.narrowest_neck_mm = json.value("narrowest_neck_mm", options.narrowest_neck_mm);
  options.smallest_cavity_mm3 = json.value("smallest_cavity_mm3", options.smallest_cavity_mm3);
  return options;
}

absl::StatusOr<RecipeMesh> ToMesh(const Json& json) {
  RecipeMesh mesh;
  mesh.edge_mm = json.value("edge_mm", mesh.edge_mm);
  mesh.fine_edge_mm = json.value("fine_edge_mm", std::min(mesh.fine_edge_mm, mesh.edge_mm));
  mesh.interior_edge_factor = json.value("interior_edge_factor", mesh.interior_edge_factor);
  mesh.min_dihedral_deg = json.value("min_dihedral_deg", mesh.min_dihedral_deg);
  if (mesh.fine_edge_mm > mesh.edge_mm) {
    return absl::InvalidArgumentError(
        "fine_edge_mm at /mesh is larger than edge_mm; it is for lips and chin");
  }
  return mesh;
}

absl::StatusOr<RecipeLips> ToLips(const Json& json) {
  RecipeLips lips;
  lips.part = json.value("part", lips.part);
  lips.vestibule_mm = json.value("vestibule_mm", lips.vestibule_mm);
  for (const Json& place : json.value("mouth_line_mm", Json::array())) {
    lips.mouth_line_mm.push_back(VectorFromJson(place));
  }
  if (!lips.part && !lips.mouth_line_mm.empty()) {
    return absl::InvalidArgumentError(
        "mouth_line_mm at /lips has no use unless \"part\" is true; set it, or leave the line out");
  }
  return lips;
}

absl::StatusOr<StiffnessTable> ToTissues(const Json& json) {
  StiffnessTable table;
  for (const Json& tissue : json) {
    table.push_back({.name = tissue.at("name"),
                     .hu_below = tissue.value("hu_below", std::numeric_limits<double>::infinity()),
                     .youngs_modulus_pa = tissue.at("youngs_modulus_pa"),
                     .source = tissue.value("source", ""),
                     .factor_95 = tissue.value("youngs_modulus_factor_95", 0.0)});
  }
  TF_RETURN_IF_ERROR(CheckStiffnessTable(table));
  return table;
}

absl::Status ReadRegionOfInterest(const Json& json, Recipe* recipe) {
  TF_RETURN_IF_ERROR(ReadPlane(json, "back", "/region_of_interest", &recipe->back));
  TF_RETURN_IF_ERROR(ReadPlane(json, "above", "/region_of_interest", &recipe->above));
  return ReadPlane(json, "below", "/region_of_interest", &recipe->below);
}

absl::Status ReadHeadFrame(const Json& json, Recipe* recipe) {
  TF_RETURN_IF_ERROR(ReadPlane(json, "midsagittal", "/head_frame", &recipe->midsagittal));
  return ReadPlane(json, "horizontal", "/head_frame", &recipe->horizontal);
}

GivenLandmarks ToLandmarks(const Json& json) {
  GivenLandmarks landmarks;
  const Json points = json.value("points_mm", Json::object());
  for (const auto& [name, place] : points.items()) landmarks[name] = VectorFromJson(place);
  return landmarks;
}

absl::StatusOr<Recipe> ToRecipe(const Json& json, const std::string& folder) {
  const Json nothing = Json::object();
  Recipe recipe;
  recipe.ct = ToCtOptions(json.value("ct", nothing));
  TF_ASSIGN_OR_RETURN(recipe.labels, ToLabels(json.value("labels", nothing), folder));
  recipe.spacing_mm = json.value("spacing_mm", recipe.spacing_mm);
  recipe.metal = ToMetal(json.value("metal", Json("auto")));
  recipe.segmentation = ToSegmentation(json.value("segmentation", nothing));
  TF_RETURN_IF_ERROR(ReadPlane(json, "occlusal_plane", "", &recipe.occlusal_plane));
  TF_RETURN_IF_ERROR(ReadSegments(json.at("segments"), folder, &recipe));
  TF_ASSIGN_OR_RETURN(recipe.surface_axes, SurfaceAxesFromJson(json.value("surfaces", nothing)));
  recipe.landmarks = ToLandmarks(json.value("landmarks", nothing));
  TF_RETURN_IF_ERROR(ReadRegionOfInterest(json.value("region_of_interest", nothing), &recipe));
  TF_RETURN_IF_ERROR(ReadHeadFrame(json.value("head_frame", nothing), &recipe));
  recipe.soft_tissue = ToSoftTissue(json.value("soft_tissue", nothing));
  TF_ASSIGN_OR_RETURN(recipe.mesh, ToMesh(json.value("mesh", nothing)));
  TF_ASSIGN_OR_RETURN(recipe.lips, ToLips(json.value("lips", nothing)));
  if (json.contains("contact_band_mm")) {
    recipe.contact_band_mm = json.at("contact_band_mm").get<double>();
  }
  if (json.contains("tissues")) {
    TF_ASSIGN_OR_RETURN(recipe.tissues, ToTissues(json.at("tissues")));
  }
  recipe.poisson_ratio = json.value("poisson_ratio", recipe.poisson_ratio);
  TF_ASSIGN_OR_RETURN(recipe.model, ModelFromName(json.value("model", "gradient_field")));
  return recipe;
}

absl::StatusOr<Recipe> ParseUnnamed(const std::string& text,
                                    const std::optional<std::string>& folder) {
  TF_ASSIGN_OR_RETURN(Json json, ParseJsonStrictly(text));
  TF_RETURN_IF_ERROR(RecipeSchema().Check(json));
  try {
    TF_RETURN_IF_ERROR(InsertMarkups(folder, &json));
    return ToRecipe(json, folder.value_or(""));
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(absl::StrCat("cannot be read: ", exception.what()));
  }
}

Json PlaneToJson(const Plane& plane) {
  return {{"point_mm", ToJson(plane.point_mm)}, {"normal", ToJson(plane.normal)}};
}

Json CtToJson(const CtReadOptions& options) {
  Json json = Json::object();
  if (options.hu_offset) json["hu_offset"] = *options.hu_offset;
  if (!options.axes.empty()) json["axes"] = options.axes;
  if (options.series_number) json["series_number"] = *options.series_number;
  if (options.join_series != JoinSeries::kAuto) {
    json["join_series"] = options.join_series == JoinSeries::kAlways ? "always" : "never";
  }
  if (options.values != CtValues::kAuto) {
    json["values"] = options.values == CtValues::kHu ? "hu" : "gray";
  }
  if (options.tissue_above_gray) json["tissue_above_gray"] = *options.tissue_above_gray;
  if (options.bone_above_gray) json["bone_above_gray"] = *options.bone_above_gray;
  return json;
}

// Without the file: its name may hold a patient's, and the report has its SHA-256.
Json LabelsToJson(const RecipeLabels& labels) {
  Json json = Json::object();
  if (!labels.convention.empty()) json["convention"] = labels.convention;
  for (const LabelRule& rule : labels.names) {
    json["names"][std::string(StructureKey(rule.structure))].push_back(
        rule.value ? Json(*rule.value) : Json(rule.name));
  }
  return json;
}

Json LipsToJson(const RecipeLips& lips) {
  Json json = {{"part", lips.part}, {"vestibule_mm", lips.vestibule_mm}};
  for (const Eigen::Vector3d& place : lips.mouth_line_mm) {
    json["mouth_line_mm"].push_back(ToJson(place));
  }
  return json;
}

Json SegmentToJson(const RecipeSegment& segment) {
  Json json = {{"name", segment.name},
               {"osteotomy", std::string(OsteotomyKindName(segment.kind))},
               {"pose", ToJson(segment.pose)}};
  for (const Plane& plane : segment.planes) json["planes"].push_back(PlaneToJson(plane));
  if (segment.dissected_mm > 0) json["dissected_mm"] = segment.dissected_mm;
  // Its own name may hold a patient's; the plan's folder has the piece under this one.
  if (segment.surface) json["surface"]["file"] = absl::StrCat("segments/", segment.name, ".stl");
  return json;
}

Json TissueToJson(const TissueClass& tissue) {
  Json json = {{"name", tissue.name},
               {"youngs_modulus_pa", tissue.youngs_modulus_pa},
               {"source", tissue.source}};
  if (std::isfinite(tissue.hu_below)) json["hu_below"] = tissue.hu_below;
  if (tissue.factor_95 != 0) json["youngs_modulus_factor_95"] = tissue.factor_95;
  return json;
}

}  // namespace

absl::StatusOr<Recipe> ReadRecipe(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrCat("recipe ", path, " does not exist or is not a file"));
  }
  std::ifstream stream(path, std::ios::binary);
  std::string text(kMaxRecipeBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(stream.gcount()));
  if (text.size() > kMaxRecipeBytes) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "recipe ", path, " has more than ", kMaxRecipeBytes, " bytes, the limit for a recipe"));
  }
  if (!stream.eof()) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot read recipe ", path, "; check its permissions"));
  }
  return ParseRecipe(text, path, std::filesystem::path(path).parent_path().string());
}

absl::StatusOr<Recipe> ParseRecipe(std::string_view json, const std::string& name,
                                   const std::optional<std::string>& folder) {
  absl::StatusOr<Recipe> recipe = ParseUnnamed(std::string(json), folder);
  if (recipe.ok()) {
    recipe->sha256 = Sha256Hex({{json.data(), json.size()}});
    return recipe;
  }
  return absl::Status(recipe.status().code(),
                      absl::StrCat("recipe ", name, ": ", recipe.status().message()));
}

std::string RecipeToJson(const Recipe& recipe) {
  Json json = {{"format", "tissueform-recipe"},
               {"ct", CtToJson(recipe.ct)},
               {"spacing_mm", recipe.spacing_mm},
               {"segmentation",
                {{"tissue_above_hu", recipe.segmentation.tissue_above_hu},
                 {"bone_above_hu", recipe.segmentation.bone_above_hu},
                 {"opening_radius_mm", recipe.segmentation.opening_radius_mm},
                 {"smallest_bone_mm3", recipe.segmentation.smallest_bone_mm3}}},
               {"soft_tissue",
                {{"thinnest_mm", recipe.soft_tissue.thinnest_mm},
                 {"narrowest_neck_mm", recipe.soft_tissue.narrowest_neck_mm},
                 {"smallest_cavity_mm3", recipe.soft_tissue.smallest_cavity_mm3}}},
               {"mesh",
                {{"edge_mm", recipe.mesh.edge_mm},
                 {"fine_edge_mm", recipe.mesh.fine_edge_mm},
                 {"interior_edge_factor", recipe.mesh.interior_edge_factor},
                 {"min_dihedral_deg", recipe.mesh.min_dihedral_deg}}},
               {"poisson_ratio", recipe.poisson_ratio},
               {"model", ModelName(recipe.model)}};
  for (const RecipeSegment& segment : recipe.segments) {
    json["segments"].push_back(SegmentToJson(segment));
  }
  for (const TissueClass& tissue : recipe.tissues) json["tissues"].push_back(TissueToJson(tissue));
  const auto add_plane = [](Json& parent, const char* key, const std::optional<Plane>& plane) {
    if (plane) parent[key] = PlaneToJson(*plane);
  };
  add_plane(json, "occlusal_plane", recipe.occlusal_plane);
  json["region_of_interest"] = Json::object();
  add_plane(json["region_of_interest"], "back", recipe.back);
  add_plane(json["region_of_interest"], "above", recipe.above);
  add_plane(json["region_of_interest"], "below", recipe.below);
  add_plane(json["head_frame"], "midsagittal", recipe.midsagittal);
  add_plane(json["head_frame"], "horizontal", recipe.horizontal);
  if (json["head_frame"].is_null()) json.erase("head_frame");
  if (recipe.contact_band_mm) json["contact_band_mm"] = *recipe.contact_band_mm;
  for (const auto& [name, place] : recipe.landmarks) {
    json["landmarks"]["points_mm"][name] = ToJson(place);
  }
  // Only where it is not the default, so that a recipe of version 1 stays one.
  if (!recipe.labels.file.empty()) json["labels"] = LabelsToJson(recipe.labels);
  if (!recipe.metal.correct) json["metal"] = "off";
  if (recipe.lips.part) json["lips"] = LipsToJson(recipe.lips);
  if (recipe.metal.threshold_hu) json["metal"] = *recipe.metal.threshold_hu;
  json["version"] = RecipeSchema().LowestVersion(json);
  return json.dump(2);
}

}  // namespace tissueform
