// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/surfaces_file.h"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/plan_building/closed_skin.h"
#include "core/planning/plan_building/segment_files.h"
#include "core/planning/plan_building/surface_source.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr double kDefaultModulusKpa = 15;
constexpr int kRecipeVersion = 7;

const JsonSchema& SurfacesSchema() {
  static const JsonSchema* const schema = new JsonSchema(SurfacesSchemaText());
  return *schema;
}

// Of its box: near the middle of the piece.
Eigen::Vector3d MiddleOf(const TriangleMesh& mesh) { return BoxOf(mesh).center(); }

// Whether the segments are surfaces, which is either all of them or none.
absl::StatusOr<bool> SegmentsAreSurfaces(const Json& segments) {
  size_t with_surface = 0;
  for (size_t s = 0; s < segments.size(); ++s) {
    const Json& segment = segments[s];
    const std::string where = absl::StrCat("/segments/", s);
    if (!segment.contains("surface") && !segment.contains("osteotomy")) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the segment at ", where, " has no \"surface\" and no \"osteotomy\"; give one of them"));
    }
    if (segment.contains("surface") && segment.contains("planes")) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"planes\" at ", where, " has no use beside \"surface\""));
    }
    if (segment.contains("surface")) ++with_surface;
  }
  if (with_surface != 0 && with_surface != segments.size()) {
    return absl::InvalidArgumentError(
        "some segments have a \"surface\" and some do not; give all as surfaces or all as "
        "osteotomies");
  }
  return with_surface != 0;
}

// One class for each surface. Classes go by place and not by HU, whose limits only keep the order.
Json TissueTable(const Json& json) {
  const Json inner = json.value("tissues", Json::array());
  Json table = Json::array();
  const auto add = [&](const std::string& name, double modulus_kpa) {
    Json tissue = {
        {"name", name}, {"youngs_modulus_pa", modulus_kpa * 1000}, {"source", "the surfaces file"}};
    if (table.size() < inner.size()) tissue["hu_below"] = table.size() + 1;
    table.push_back(std::move(tissue));
  };
  add("soft_tissue", json.value("young_modulus_kpa", kDefaultModulusKpa));
  for (const Json& tissue : inner) add(tissue.at("name"), tissue.at("young_modulus_kpa"));
  return table;
}

// What the file says besides the surfaces, as a recipe.
absl::StatusOr<Recipe> RecipeOf(const Json& json, const std::string& path) {
  Json recipe = {{"format", "tissueform-recipe"}, {"version", kRecipeVersion}};
  for (const char* key : {"spacing_mm", "region_of_interest", "head_frame", "lips", "soft_tissue",
                          "mesh", "contact_band_mm", "poisson_ratio", "model", "landmarks"}) {
    if (json.contains(key)) recipe[key] = json.at(key);
  }
  for (Json segment : json.at("segments")) {
    for (const char* key : {"surface", "transform", "transform_maps", "moved"}) segment.erase(key);
    if (!segment.contains("osteotomy")) segment["osteotomy"] = "bssro";
    recipe["segments"].push_back(std::move(segment));
  }
  recipe["tissues"] = TissueTable(json);
  return ParseRecipe(recipe.dump(), path, fs::path(path).parent_path().string());
}

absl::Status ReadSegmentSurfaces(const Json& segments, const std::string& folder,
                                 const Recipe& recipe, SurfaceReader* reader,
                                 HeadSurfaces* surfaces) {
  for (size_t s = 0; s < segments.size(); ++s) {
    const Json& surface = segments[s].at("surface");
    SegmentSurface segment{.name = recipe.segments[s].name,
                           .mesh = surfaces->lower_jaw,
                           .of_lower_jaw = recipe.segments[s].kind != OsteotomyKind::kLeFort1};
    if (surface.is_object()) {
      const std::string role = absl::StrCat("segment \"", segment.name, "\"");
      TF_ASSIGN_OR_RETURN(segment.mesh, reader->Read(SurfaceFromJson(surface, folder), role));
    }
    surfaces->segments.push_back(std::move(segment));
  }
  return absl::OkStatus();
}

// Replaces the poses of segments whose movement files give, with a note on each.
absl::Status ReadMoves(const Json& segments, const std::string& folder,
                       const HeadSurfaces& surfaces, SurfaceReader* reader, Recipe* recipe,
                       std::vector<std::string>* notes) {
  for (size_t s = 0; s < segments.size(); ++s) {
    RecipeSegment& segment = recipe->segments[s];
    TF_ASSIGN_OR_RETURN(const MoveSource source,
                        MoveSourceFromJson(segments[s], absl::StrCat("/segments/", s), folder));
    if (!source.any()) continue;
    const std::string role = absl::StrCat("segment \"", segment.name, "\"");
    const bool upper = segment.kind == OsteotomyKind::kLeFort1;
    const TriangleMesh& piece = !surfaces.segments.empty() ? surfaces.segments[s].mesh
                                : upper                    ? surfaces.skull
                                                           : surfaces.lower_jaw;
    TF_ASSIGN_OR_RETURN(const FileMove move, ReadMove(source, &piece, role, reader));
    segment.pose = PoseOf(move.move, MiddleOf(piece));
    notes->push_back(MoveNote("The middle of " + role, segment.pose, move));
  }
  return absl::OkStatus();
}

absl::StatusOr<SurfacesInput> ReadParsed(const Json& json, const std::string& path, int threads) {
  TF_ASSIGN_OR_RETURN(SurfaceAxes axes, SurfaceAxesFromJson(json));
  TF_ASSIGN_OR_RETURN(const bool pieces, SegmentsAreSurfaces(json.at("segments")));
  TF_ASSIGN_OR_RETURN(Recipe recipe, RecipeOf(json, path));
  const std::string folder = fs::path(path).parent_path().string();
  SurfaceReader reader(std::move(axes), threads);
  const auto read = [&](const Json& surface, const std::string& role) {
    return reader.Read(SurfaceFromJson(surface, folder), role);
  };
  TF_ASSIGN_OR_RETURN(TriangleMesh skin, read(json.at("skin"), "skin"));
  TF_ASSIGN_OR_RETURN(TriangleMesh skull, read(json.at("skull"), "skull"));
  TF_ASSIGN_OR_RETURN(TriangleMesh lower_jaw, read(json.at("lower_jaw"), "lower jaw"));
  HeadSurfaces surfaces{.skin = std::move(skin),
                        .skull = std::move(skull),
                        .lower_jaw = std::move(lower_jaw),
                        .segments = {},
                        .tissues = {}};
  if (pieces) {
    TF_RETURN_IF_ERROR(
        ReadSegmentSurfaces(json.at("segments"), folder, recipe, &reader, &surfaces));
  }
  for (const Json& tissue : json.value("tissues", Json::array())) {
    const std::string role = absl::StrCat("tissue \"", tissue.at("name").get<std::string>(), "\"");
    TF_ASSIGN_OR_RETURN(TriangleMesh mesh, read(tissue.at("surface"), role));
    surfaces.tissues.push_back(std::move(mesh));
  }
  std::vector<std::string> move_notes;
  TF_RETURN_IF_ERROR(
      ReadMoves(json.at("segments"), folder, surfaces, &reader, &recipe, &move_notes));
  CtProvenance provenance;
  provenance.format = "surfaces";
  provenance.num_files = reader.num_files() + 1;
  provenance.sha256 = Sha256Hex({json.dump(), reader.digests()});
  provenance.notes = {
      "Built from surfaces alone, without a CT: soft tissue is what the skin encloses without "
      "bone; HU in this report are made from the surfaces."};
  for (std::string& note : reader.Notes()) provenance.notes.push_back(std::move(note));
  provenance.notes.insert(provenance.notes.end(), move_notes.begin(), move_notes.end());
  return SurfacesInput{.surfaces = std::move(surfaces),
                       .recipe = std::move(recipe),
                       .provenance = std::move(provenance),
                       .roles = reader.roles()};
}

// `path`: to which the paths in the text are relative.
absl::StatusOr<SurfacesInput> ReadUnnamed(const std::string& text, const std::string& path,
                                          int threads) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  TF_RETURN_IF_ERROR(SurfacesSchema().Check(json));
  try {
    return ReadParsed(json, path, threads);
  } catch (const Json::exception& exception) {
    return absl::InvalidArgumentError(absl::StrCat("cannot be read: ", exception.what()));
  }
}

}  // namespace

absl::StatusOr<SurfacesInput> ReadSurfaces(const std::string& path, int threads) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(path, "surfaces", kMaxRecipeBytes));
  absl::StatusOr<SurfacesInput> input = ReadUnnamed(text, path, threads);
  if (input.ok()) return input;
  return absl::Status(input.status().code(),
                      absl::StrCat("surfaces ", path, ": ", input.status().message()));
}

}  // namespace tissueform
