// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/surfaces_file.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/border_loops.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/generation/surface_wrapping.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/payload/sha256.h"
#include "core/mesh/surface_validation.h"
#include "core/planning/plan_building/closed_skin.h"
#include "core/planning/plan_building/segment_move.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr double kDefaultModulusKpa = 15;
constexpr int kRecipeVersion = 4;
constexpr size_t kMaxTransformBytes = size_t{1} << 16;

// Turned neighbours at more edges than this part make inside and outside unclear.
constexpr double kLargestTurnedFraction = 0.02;

const JsonSchema& SurfacesSchema() {
  static const JsonSchema* const schema = new JsonSchema(SurfacesSchemaText());
  return *schema;
}

// Vertices at exactly one place become one, as programs write each triangle with corners of its
// own. Triangles that lose a corner by that are left out.
absl::StatusOr<TriangleMesh> Welded(const Positions& positions, const TriangleIndices& triangles) {
  std::map<std::array<double, 3>, int32_t> place_of;
  std::vector<int32_t> vertex(static_cast<size_t>(positions.rows()));
  std::vector<Eigen::RowVector3d> kept;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const auto [place, is_new] = place_of.try_emplace(
        {positions(v, 0), positions(v, 1), positions(v, 2)}, static_cast<int32_t>(kept.size()));
    if (is_new) kept.emplace_back(positions.row(v));
    vertex[static_cast<size_t>(v)] = place->second;
  }
  std::vector<Eigen::RowVector3i> corners;
  for (const auto& t : triangles.rowwise()) {
    const Eigen::RowVector3i c(vertex[static_cast<size_t>(t[0])], vertex[static_cast<size_t>(t[1])],
                               vertex[static_cast<size_t>(t[2])]);
    if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) corners.push_back(c);
  }
  Positions welded(static_cast<Eigen::Index>(kept.size()), 3);
  for (size_t v = 0; v < kept.size(); ++v) welded.row(static_cast<Eigen::Index>(v)) = kept[v];
  TriangleIndices faces(static_cast<Eigen::Index>(corners.size()), 3);
  for (size_t f = 0; f < corners.size(); ++f) faces.row(static_cast<Eigen::Index>(f)) = corners[f];
  return TriangleMesh::Create(std::move(welded), std::move(faces));
}

// Reads the surfaces of one file, one after the other.
class SurfacesReader {
 public:
  SurfacesReader(const std::string& path, const Json& json, int threads)
      : folder_(fs::path(path).parent_path()), json_(json), threads_(threads) {
    const std::string units = json.value("units", "mm");
    scale_ = json.value("scale", units == "m" ? 1000.0 : units == "cm" ? 10.0 : 1.0);
  }

  absl::StatusOr<TriangleMesh> Read(const Json& surface, const std::string& role) {
    absl::StatusOr<TriangleMesh> mesh = ReadUnnamed(surface, role);
    if (mesh.ok()) return mesh;
    return absl::Status(mesh.status().code(), absl::StrCat(role, ": ", mesh.status().message()));
  }

  std::string PathOf(const Json& file) const {
    return (folder_ / file.get<std::string>()).string();
  }

  // What was given and what was assumed.
  std::vector<std::string> Notes() const {
    std::vector<std::string> notes = {
        "Built from surfaces alone, without a CT: soft tissue is what the skin encloses without "
        "bone; HU in this report are made from the surfaces."};
    if (json_.contains("units") || json_.contains("scale")) {
      notes.push_back(absl::StrFormat("One unit of the surfaces is %g mm.", scale_));
    } else {
      notes.push_back("The surfaces' unit is not given; mm are assumed.");
    }
    if (!of_space_[FileSpace::kUnstated].empty()) {
      const bool given = json_.contains("coordinate_system");
      notes.push_back(absl::StrCat("Axes of ", of_space_.at(FileSpace::kUnstated), ": ",
                                   given ? json_.at("coordinate_system").get<std::string>() +
                                               ", as the surfaces file states."
                                         : "not stated; LPS is assumed."));
    }
    for (const auto& [space, name] :
         {std::pair(FileSpace::kRas, "RAS"), {FileSpace::kLps, "LPS"}}) {
      if (of_space_[space].empty()) continue;
      notes.push_back(
          absl::StrCat("Axes of ", of_space_[space], ": ", name, ", as the file's header states."));
    }
    return notes;
  }

  int num_files() const { return num_files_; }
  const std::string& digests() const { return digests_; }

 private:
  absl::StatusOr<TriangleMesh> ReadUnnamed(const Json& surface, const std::string& role) {
    const std::string path = PathOf(surface.at("file"));
    TF_ASSIGN_OR_RETURN(const TriangleMeshFile file, ReadTriangleMesh(path));
    std::string& roles = of_space_[file.space];
    absl::StrAppend(&roles, roles.empty() ? "" : ", ", role);
    TF_RETURN_IF_ERROR(AddDigest(path));
    Positions positions = file.mesh.positions() * scale_;
    if (!positions.allFinite()) {
      return absl::InvalidArgumentError("some coordinates are not finite numbers");
    }
    if (file.space == FileSpace::kUnstated && json_.value("coordinate_system", "LPS") == "RAS") {
      positions.leftCols(2) *= -1;
    }
    TriangleIndices triangles = file.mesh.triangles();
    if (surface.value("flip", false)) triangles.col(1).swap(triangles.col(2));
    TF_ASSIGN_OR_RETURN(const TriangleMesh mesh, Welded(positions, triangles));
    return surface.contains("wrap_mm") ? Wrapped(mesh, surface.at("wrap_mm")) : Oriented(mesh);
  }

  // Openings are closed first: the wrap would enter wide ones and enclose a sheet. Afterwards its
  // vertices go back to the surface from the offset, by which bones would be too thick.
  absl::StatusOr<TriangleMesh> Wrapped(const TriangleMesh& mesh, double offset_mm) const {
    WrappingOptions options;
    options.offset_mm = offset_mm;
    options.threads = threads_;
    const TriangleMesh closed = WithOpeningsClosed(mesh, BorderLoops(mesh));
    TF_ASSIGN_OR_RETURN(const WrappedSurface wrapped, WrapSurface(closed, options));
    return TriangleMesh::Create(NearestPoints(closed).Of(wrapped.mesh.positions()),
                                wrapped.mesh.triangles());
  }

  static absl::StatusOr<TriangleMesh> Oriented(const TriangleMesh& mesh) {
    const SurfaceReport report = ValidateTriangleMesh(mesh);
    const MeshDefect* turned = report.Find("turned_triangles");
    if (turned == nullptr || static_cast<double>(turned->count) <=
                                 kLargestTurnedFraction * static_cast<double>(report.num_edges)) {
      return mesh;
    }
    return absl::InvalidArgumentError(absl::StrFormat(
        "at %d edges neighbouring triangles face opposite sides, so that inside and outside are "
        "unclear; orient the triangles, or have the surface wrapped (\"wrap_mm\")",
        turned->count));
  }

  absl::Status AddDigest(const std::string& path) {
    ++num_files_;
    std::ifstream stream(path, std::ios::binary);
    Sha256 digest;
    std::string block(size_t{1} << 20, '\0');
    while (stream.read(block.data(), static_cast<std::streamsize>(block.size())) ||
           stream.gcount() > 0) {
      digest.Add({block.data(), static_cast<size_t>(stream.gcount())});
    }
    if (!stream.eof()) return absl::DataLossError("the file changed while it was read");
    digests_ += digest.Hex();
    return absl::OkStatus();
  }

  const fs::path folder_;
  const Json& json_;
  const int threads_;
  double scale_ = 1;
  int num_files_ = 0;
  std::string digests_;
  mutable std::map<FileSpace, std::string> of_space_;  // roles by what their files state
};

// Of its box: near the middle of the piece.
Eigen::Vector3d MiddleOf(const TriangleMesh& mesh) { return BoxOf(mesh).center(); }

absl::StatusOr<HandlePose> PoseFromTransform(const std::string& path, const TriangleMesh& piece) {
  TF_ASSIGN_OR_RETURN(const std::string text,
                      ReadJsonText(path, "transform file", kMaxTransformBytes));
  TF_ASSIGN_OR_RETURN(const RigidMove move, ParseItkTransform(text));
  return PoseOf(move, MiddleOf(piece));
}

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
    if (segment.contains("moved") && !segment.contains("surface")) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"moved\" at ", where, " needs a \"surface\" that is fitted to it"));
    }
    if (segment.contains("pose") + segment.contains("transform") + segment.contains("moved") > 1) {
      return absl::InvalidArgumentError(absl::StrCat("\"pose\", \"transform\" and \"moved\" at ",
                                                     where, " exclude each other; give one"));
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
                          "mesh", "contact_band_mm", "poisson_ratio", "model"}) {
    if (json.contains(key)) recipe[key] = json.at(key);
  }
  for (Json segment : json.at("segments")) {
    for (const char* key : {"surface", "transform", "moved"}) segment.erase(key);
    if (!segment.contains("osteotomy")) segment["osteotomy"] = "bssro";
    recipe["segments"].push_back(std::move(segment));
  }
  recipe["tissues"] = TissueTable(json);
  return ParseRecipe(recipe.dump(), path);
}

absl::Status ReadSegmentSurfaces(const Json& segments, const Recipe& recipe, SurfacesReader* reader,
                                 HeadSurfaces* surfaces) {
  for (size_t s = 0; s < segments.size(); ++s) {
    const Json& surface = segments[s].at("surface");
    SegmentSurface segment{.name = recipe.segments[s].name,
                           .mesh = surfaces->lower_jaw,
                           .of_lower_jaw = recipe.segments[s].kind != OsteotomyKind::kLeFort1};
    if (surface.is_object()) {
      const std::string role = absl::StrCat("segment \"", segment.name, "\"");
      TF_ASSIGN_OR_RETURN(segment.mesh, reader->Read(surface, role));
    }
    surfaces->segments.push_back(std::move(segment));
  }
  return absl::OkStatus();
}

// Replaces the poses of segments that give a transform or a moved surface, with a note on each.
absl::Status ReadMoves(const Json& segments, const HeadSurfaces& surfaces, SurfacesReader* reader,
                       Recipe* recipe, std::vector<std::string>* notes) {
  for (size_t s = 0; s < segments.size(); ++s) {
    RecipeSegment& segment = recipe->segments[s];
    const std::string role = absl::StrCat("segment \"", segment.name, "\"");
    const bool upper = segment.kind == OsteotomyKind::kLeFort1;
    const TriangleMesh& piece = !surfaces.segments.empty() ? surfaces.segments[s].mesh
                                : upper                    ? surfaces.skull
                                                           : surfaces.lower_jaw;
    if (segments[s].contains("transform")) {
      absl::StatusOr<HandlePose> pose =
          PoseFromTransform(reader->PathOf(segments[s].at("transform")), piece);
      if (!pose.ok()) {
        return absl::Status(pose.status().code(),
                            absl::StrCat(role, ": ", pose.status().message()));
      }
      segment.pose = *pose;
      notes->push_back(absl::StrCat("The middle of ", role, " ", MoveText(segment.pose),
                                    ": the inverse of its transform file, which maps points from "
                                    "after the movement to before it."));
    } else if (segments[s].contains("moved")) {
      TF_ASSIGN_OR_RETURN(const TriangleMesh moved,
                          reader->Read(segments[s].at("moved"), "moved " + role));
      absl::StatusOr<RigidFit> fit = FitRigidly(piece, moved);
      if (!fit.ok()) {
        return absl::Status(fit.status().code(), absl::StrCat(role, ": ", fit.status().message()));
      }
      segment.pose = PoseOf(fit->move, MiddleOf(piece));
      notes->push_back(absl::StrFormat(
          "The middle of %s %s: the rigid fit to its moved surface, which leaves %.2f mm RMS.",
          role, MoveText(segment.pose), fit->rms_mm));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<SurfacesInput> ReadParsed(const Json& json, const std::string& path, int threads) {
  if (json.contains("units") && json.contains("scale")) {
    return absl::InvalidArgumentError("\"units\" and \"scale\" exclude each other; give one");
  }
  TF_ASSIGN_OR_RETURN(const bool pieces, SegmentsAreSurfaces(json.at("segments")));
  TF_ASSIGN_OR_RETURN(Recipe recipe, RecipeOf(json, path));
  SurfacesReader reader(path, json, threads);
  TF_ASSIGN_OR_RETURN(TriangleMesh skin, reader.Read(json.at("skin"), "skin"));
  TF_ASSIGN_OR_RETURN(TriangleMesh skull, reader.Read(json.at("skull"), "skull"));
  TF_ASSIGN_OR_RETURN(TriangleMesh lower_jaw, reader.Read(json.at("lower_jaw"), "lower jaw"));
  HeadSurfaces surfaces{.skin = std::move(skin),
                        .skull = std::move(skull),
                        .lower_jaw = std::move(lower_jaw),
                        .segments = {},
                        .tissues = {}};
  if (pieces) {
    TF_RETURN_IF_ERROR(ReadSegmentSurfaces(json.at("segments"), recipe, &reader, &surfaces));
  }
  for (const Json& tissue : json.value("tissues", Json::array())) {
    const std::string role = absl::StrCat("tissue \"", tissue.at("name").get<std::string>(), "\"");
    TF_ASSIGN_OR_RETURN(TriangleMesh mesh, reader.Read(tissue.at("surface"), role));
    surfaces.tissues.push_back(std::move(mesh));
  }
  std::vector<std::string> move_notes;
  TF_RETURN_IF_ERROR(ReadMoves(json.at("segments"), surfaces, &reader, &recipe, &move_notes));
  CtProvenance provenance;
  provenance.format = "surfaces";
  provenance.num_files = reader.num_files() + 1;
  provenance.sha256 = Sha256Hex({json.dump(), reader.digests()});
  provenance.notes = reader.Notes();
  provenance.notes.insert(provenance.notes.end(), move_notes.begin(), move_notes.end());
  return SurfacesInput{.surfaces = std::move(surfaces),
                       .recipe = std::move(recipe),
                       .provenance = std::move(provenance)};
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
