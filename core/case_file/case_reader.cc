// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/case_file/case_reader.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/case_file/glb_container.h"
#include "core/case_file/surface_parser.h"
#include "core/json/json_file.h"
#include "core/json/json_schema.h"
#include "core/mesh_payload/mesh_payload.h"
#include "core/mesh_payload/sha256.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Json = nlohmann::json;

const JsonSchema& CaseSchema() {
  static const JsonSchema* const schema = new JsonSchema(CaseSchemaText());
  return *schema;
}

// From here on `ours` has passed the schema: keys that it requires are there and have their types.

Vector3d VectorOf(const Json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

std::string TextOf(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found == json.end() ? "" : found->get<std::string>();
}

// Titles and labels go to terminals and pages: no line breaks, no escape sequences.
absl::Status CheckIsOneLine(const Json& json, const std::string& where) {
  if (json.is_string()) {
    const std::string& text = json.get_ref<const std::string&>();
    const bool has_control = std::any_of(text.begin(), text.end(), [](char c) {
      return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    });
    if (has_control) return BrokenCase(where, "holds a control character");
  }
  if (!json.is_structured()) return absl::OkStatus();
  for (const auto& [key, value] : json.items()) {
    TF_RETURN_IF_ERROR(CheckIsOneLine(value, absl::StrCat(where, "/", key)));
  }
  return absl::OkStatus();
}

constexpr char kMeshNamePrefix[] = "meshes/";

absl::StatusOr<CaseMesh> ParseMesh(const Glb& glb, const Json& json) {
  CaseMesh mesh;
  mesh.name = TextOf(json, "name");
  mesh.vertex_count = json["vertex_count"].get<int64_t>();
  mesh.tet_count = json["tet_count"].get<int64_t>();
  mesh.cell_arrays = json["cell_arrays"].get<std::vector<std::string>>();
  TF_ASSIGN_OR_RETURN(const absl::string_view payload, ViewOf(glb, json, "payload", "/mesh"));
  const MeshPayloadShape shape{mesh.vertex_count, mesh.tet_count, mesh.cell_arrays};
  if (shape.TotalBytes() != static_cast<int64_t>(payload.size())) {
    return BrokenCase("/mesh/payload", absl::StrCat("has ", payload.size(),
                                                    " bytes; its counts say ", shape.TotalBytes()));
  }
  if (absl::StrCat(kMeshNamePrefix, Sha256Hex({shape.Text(), payload})) != mesh.name) {
    return absl::DataLossError(
        "the mesh in the case is not the one that its name says; get the case again");
  }
  mesh.payload = std::string(payload);
  return mesh;
}

CaseHandle ParseHandle(const Json& json) {
  CaseHandle handle;
  handle.name = TextOf(json, "name");
  handle.label = TextOf(json, "label");
  handle.pivot_mm = VectorOf(json["pivot_mm"]);
  const Json& pose = json["pose"];
  handle.pose = {.rotation_vector = VectorOf(pose["rotation_vector_deg"]) * (M_PI / 180),
                 .pivot_mm = VectorOf(pose["pivot_mm"]),
                 .translation_mm = VectorOf(pose["translation_mm"]),
                 .scale = pose["scale"].get<double>()};
  handle.most_translation_mm = json["limits"]["translation_mm"].get<double>();
  handle.most_rotation_deg = json["limits"]["rotation_deg"].get<double>();
  return handle;
}

CaseLandmark ParseLandmark(const Json& json) {
  CaseLandmark landmark;
  landmark.name = TextOf(json, "name");
  landmark.label = TextOf(json, "label");
  landmark.position_mm = VectorOf(json["position_mm"]);
  landmark.handle = TextOf(json, "handle");
  if (json.contains("skin_vertex")) landmark.skin_vertex = json["skin_vertex"].get<int32_t>();
  return landmark;
}

// What needs no bytes of the file.
void ParsePlainKeys(const Json& ours, CaseFile* contents) {
  contents->title = TextOf(ours, "title");
  const Json& provenance = ours["provenance"];
  contents->software = TextOf(provenance, "software");
  contents->commit = TextOf(provenance, "commit");
  contents->created = TextOf(provenance, "created");
  contents->plan_sha256 = TextOf(provenance, "plan_sha256");
  contents->model = TextOf(ours, "model");
  for (const Json& region : ours["skin_regions"]) {
    contents->skin_regions.push_back(
        {region["number"].get<int>(), TextOf(region, "name"), TextOf(region, "label")});
  }
  for (const Json& handle : ours["handles"]) contents->handles.push_back(ParseHandle(handle));
  for (const Json& landmark : ours["landmarks"]) {
    contents->landmarks.push_back(ParseLandmark(landmark));
  }
  const Json& frame = ours["head_frame"];
  contents->head_frame = {.origin_mm = VectorOf(frame["origin_mm"]),
                          .left = VectorOf(frame["left"]),
                          .posterior = VectorOf(frame["posterior"]),
                          .superior = VectorOf(frame["superior"]),
                          .source = TextOf(frame, "source")};
}

absl::Status ParseBytes(const Glb& glb, const Json& ours, CaseFile* contents) {
  TF_ASSIGN_OR_RETURN(contents->mesh, ParseMesh(glb, ours["mesh"]));
  TF_ASSIGN_OR_RETURN(const absl::string_view request, ViewOf(glb, ours, "session_request", ""));
  contents->session_request = std::string(request);
  if (ours.contains("material_ranges")) {
    TF_ASSIGN_OR_RETURN(const absl::string_view ranges, ViewOf(glb, ours, "material_ranges", ""));
    contents->material_ranges = std::string(ranges);
  }
  // Several surfaces may name one buffer view: together they are held to what one file may hold.
  size_t bytes = 0;
  for (size_t s = 0; s < ours["surfaces"].size(); ++s) {
    const std::string where = absl::StrCat("/surfaces/", s);
    TF_ASSIGN_OR_RETURN(CaseSurface surface,
                        ParseSurface(glb, ours["surfaces"][s], contents->mesh.vertex_count, where));
    bytes += static_cast<size_t>(surface.positions.size() + surface.triangles.size()) * 4;
    if (bytes > kMostCaseBytes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the surfaces have more than ", kMostCaseBytes, " bytes together"));
    }
    contents->surfaces.push_back(std::move(surface));
  }
  return absl::OkStatus();
}

// Each name once, and what refers to one refers to one that there is.
absl::Status CheckNames(const CaseFile& contents) {
  std::set<std::string> handles = {""};
  for (const CaseHandle& handle : contents.handles) {
    if (!handles.insert(handle.name).second) return BrokenCase("/handles", "has a name twice");
  }
  std::set<int> regions = {0};
  for (const CaseSkinRegion& region : contents.skin_regions) {
    if (!regions.insert(region.number).second) {
      return BrokenCase("/skin_regions", "has a number twice");
    }
  }
  for (size_t s = 0; s < contents.surfaces.size(); ++s) {
    const CaseSurface& surface = contents.surfaces[s];
    const std::string where = absl::StrCat("/surfaces/", s);
    if (handles.count(surface.handle) == 0) {
      return BrokenCase(where + "/handle", "names a handle that there is not");
    }
    if (surface.kind == SurfaceKind::kSegment && surface.handle.empty()) {
      return BrokenCase(where, "is a segment and has no handle");
    }
    const bool has_stray = std::any_of(surface.regions.begin(), surface.regions.end(),
                                       [&](uint8_t r) { return regions.count(r) == 0; });
    if (has_stray) return BrokenCase(where + "/regions", "has a number of no skin region");
  }
  return absl::OkStatus();
}

absl::Status CheckLandmarks(const CaseFile& contents) {
  const auto skin = std::find_if(contents.surfaces.begin(), contents.surfaces.end(),
                                 [](const CaseSurface& s) { return s.kind == SurfaceKind::kSkin; });
  const Index skin_vertices = skin == contents.surfaces.end() ? 0 : skin->positions.rows();
  for (size_t l = 0; l < contents.landmarks.size(); ++l) {
    const CaseLandmark& landmark = contents.landmarks[l];
    const std::string where = absl::StrCat("/landmarks/", l);
    const bool has_handle =
        landmark.handle.empty() ||
        std::any_of(contents.handles.begin(), contents.handles.end(),
                    [&](const CaseHandle& h) { return h.name == landmark.handle; });
    if (!has_handle) return BrokenCase(where + "/handle", "names a handle that there is not");
    if (landmark.skin_vertex && *landmark.skin_vertex >= skin_vertices) {
      return BrokenCase(where + "/skin_vertex",
                        absl::StrCat("is none of the skin's ", skin_vertices, " vertices"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Json> OurExtension(const Glb& glb) {
  const auto extensions = glb.root.find("extensions");
  if (extensions == glb.root.end() || !extensions->is_object() ||
      !extensions->contains(kCaseExtension)) {
    return absl::InvalidArgumentError(absl::StrCat("not a case: a glTF file without ",
                                                   kCaseExtension,
                                                   "; make one by `tissueform case pack`"));
  }
  Json ours = (*extensions)[kCaseExtension];
  if (const absl::Status status = CaseSchema().Check(ours); !status.ok()) {
    return absl::Status(status.code(), absl::StrCat("not a usable case: ", status.message()));
  }
  TF_RETURN_IF_ERROR(CheckIsOneLine(ours, ""));
  return ours;
}

}  // namespace

absl::StatusOr<CaseFile> ParseCase(absl::string_view bytes) {
  if (bytes.size() > kMostCaseBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("it has ", bytes.size(), " bytes; at most ", kMostCaseBytes, " are read"));
  }
  TF_ASSIGN_OR_RETURN(const Glb glb, ParseGlb(bytes, kMostCaseJsonBytes));
  TF_ASSIGN_OR_RETURN(const Json ours, OurExtension(glb));
  CaseFile contents;
  ParsePlainKeys(ours, &contents);
  TF_RETURN_IF_ERROR(CheckHeadFrame(contents.head_frame));
  TF_RETURN_IF_ERROR(ParseBytes(glb, ours, &contents));
  TF_RETURN_IF_ERROR(CheckNames(contents));
  TF_RETURN_IF_ERROR(CheckLandmarks(contents));
  return contents;
}

absl::StatusOr<CaseFile> ReadCase(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadJsonText(path, "case", kMostCaseBytes));
  absl::StatusOr<CaseFile> contents = ParseCase(bytes);
  if (contents.ok()) return contents;
  return absl::Status(contents.status().code(),
                      absl::StrCat("case ", path, ": ", contents.status().message()));
}

}  // namespace tissueform
