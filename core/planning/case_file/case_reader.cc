// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/case_reader.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/extension_parser.h"
#include "core/planning/case_file/glb_container.h"
#include "core/planning/case_file/surface_parser.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

const JsonSchema& CaseSchema() {
  static const JsonSchema* const schema = new JsonSchema(CaseSchemaText());
  return *schema;
}

// From here on `ours` has passed the schema: keys that it requires are there and have their types.

constexpr char kMeshNamePrefix[] = "meshes/";

absl::StatusOr<CaseMesh> ParseMesh(const Glb& glb, const Json& json) {
  CaseMesh mesh;
  mesh.name = TextIn(json, "name");
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
    return absl::DataLossError("the case's mesh does not match its digest; get the case again");
  }
  mesh.payload = std::string(payload);
  return mesh;
}

CaseHandle ParseHandle(const Json& json) {
  CaseHandle handle;
  handle.name = TextIn(json, "name");
  handle.label = TextIn(json, "label");
  handle.pivot_mm = VectorIn(json["pivot_mm"]);
  const Json& pose = json["pose"];
  handle.pose = {.rotation_vector = VectorIn(pose["rotation_vector_deg"]) * (M_PI / 180),
                 .pivot_mm = VectorIn(pose["pivot_mm"]),
                 .translation_mm = VectorIn(pose["translation_mm"]),
                 .scale = pose["scale"].get<double>()};
  handle.most_translation_mm = json["limits"]["translation_mm"].get<double>();
  handle.most_rotation_deg = json["limits"]["rotation_deg"].get<double>();
  return handle;
}

// What needs no bytes of the file.
void ParsePlainKeys(const Json& ours, CaseFile* contents) {
  contents->title = TextIn(ours, "title");
  const Json& provenance = ours["provenance"];
  contents->software = TextIn(provenance, "software");
  contents->commit = TextIn(provenance, "commit");
  contents->created = TextIn(provenance, "created");
  contents->plan_sha256 = TextIn(provenance, "plan_sha256");
  contents->model = TextIn(ours, "model");
  for (const Json& region : ours["skin_regions"]) {
    contents->skin_regions.push_back(
        {region["number"].get<int>(), TextIn(region, "name"), TextIn(region, "label")});
  }
  for (const Json& handle : ours["handles"]) contents->handles.push_back(ParseHandle(handle));
  contents->landmarks = ParseLandmarks(ours["landmarks"]);
  contents->head_frame = ParseHeadFrame(ours["head_frame"]);
}

absl::StatusOr<CaseContact> ParseContact(const Glb& glb, const Json& json,
                                         const CaseFile& contents) {
  CaseContact contact{.rows = json["rows"].get<int64_t>(), .sticking = {}};
  if (!json.contains("sticking")) return contact;
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, ViewOf(glb, json, "sticking", "/contact"));
  constexpr size_t kBytesOfPair = 2 * sizeof(int32_t);
  if (bytes.size() % kBytesOfPair != 0) {
    return BrokenCase("/contact/sticking",
                      absl::StrCat("has ", bytes.size(), " bytes, which are not pairs of int32"));
  }
  contact.sticking.resize(static_cast<Eigen::Index>(bytes.size() / kBytesOfPair), 2);
  std::memcpy(contact.sticking.data(), bytes.data(), bytes.size());
  const auto num_handles = static_cast<int32_t>(contents.handles.size());
  int32_t before = -1;
  for (const auto& pair : contact.sticking.rowwise()) {
    if (pair[0] <= before || pair[0] >= contents.mesh.vertex_count) {
      return BrokenCase("/contact/sticking",
                        absl::StrCat("has vertex ", pair[0], " after ", before, " of a mesh with ",
                                     contents.mesh.vertex_count, "; vertices must rise"));
    }
    if (pair[1] < -1 || pair[1] >= num_handles) {
      return BrokenCase("/contact/sticking",
                        absl::StrCat("names region ", pair[1], " of ", num_handles, " handles"));
    }
    before = pair[0];
  }
  return contact;
}

absl::Status ParseBytes(const Glb& glb, const Json& ours, CaseFile* contents) {
  TF_ASSIGN_OR_RETURN(contents->mesh, ParseMesh(glb, ours["mesh"]));
  TF_ASSIGN_OR_RETURN(const absl::string_view request, ViewOf(glb, ours, "session_request", ""));
  contents->session_request = std::string(request);
  if (ours.contains("material_ranges")) {
    TF_ASSIGN_OR_RETURN(const absl::string_view ranges, ViewOf(glb, ours, "material_ranges", ""));
    contents->material_ranges = std::string(ranges);
  }
  if (ours.contains("contact")) {
    TF_ASSIGN_OR_RETURN(contents->contact, ParseContact(glb, ours["contact"], *contents));
  }
  TF_ASSIGN_OR_RETURN(contents->surfaces,
                      ParseSurfaces(glb, ours["surfaces"], contents->mesh.vertex_count));
  return absl::OkStatus();
}

// Each name once, and what refers to one refers to one that there is.
absl::Status CheckNames(const CaseFile& contents) {
  std::vector<std::string> handles;
  for (const CaseHandle& handle : contents.handles) {
    if (std::find(handles.begin(), handles.end(), handle.name) != handles.end()) {
      return BrokenCase("/handles", "has a duplicate name");
    }
    handles.push_back(handle.name);
  }
  std::set<int> regions = {0};
  for (const CaseSkinRegion& region : contents.skin_regions) {
    if (!regions.insert(region.number).second) {
      return BrokenCase("/skin_regions", "has a duplicate number");
    }
  }
  for (size_t s = 0; s < contents.surfaces.size(); ++s) {
    const CaseSurface& surface = contents.surfaces[s];
    const std::string where = absl::StrCat("/surfaces/", s);
    const bool has_stray = std::any_of(surface.regions.begin(), surface.regions.end(),
                                       [&](uint8_t r) { return regions.count(r) == 0; });
    if (has_stray) return BrokenCase(where + "/regions", "has a number that is not a skin region");
  }
  return CheckReferences(contents.surfaces, contents.landmarks, handles);
}

}  // namespace

absl::StatusOr<CaseFile> ParseCase(absl::string_view bytes) {
  if (bytes.size() > kMaxCaseBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("it has ", bytes.size(), " bytes; at most ", kMaxCaseBytes, " are read"));
  }
  TF_ASSIGN_OR_RETURN(const Glb glb, ParseGlb(bytes, kMaxCaseJsonBytes));
  TF_ASSIGN_OR_RETURN(const Json ours, ParseExtension(glb, kCaseExtension, CaseSchema()));
  CaseFile contents;
  ParsePlainKeys(ours, &contents);
  TF_RETURN_IF_ERROR(CheckHeadFrame(contents.head_frame));
  TF_RETURN_IF_ERROR(ParseBytes(glb, ours, &contents));
  TF_RETURN_IF_ERROR(CheckNames(contents));
  return contents;
}

absl::StatusOr<CaseFile> ReadCase(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadJsonText(path, "case", kMaxCaseBytes));
  absl::StatusOr<CaseFile> contents = ParseCase(bytes);
  if (contents.ok()) return contents;
  return absl::Status(contents.status().code(),
                      absl::StrCat("case ", path, ": ", contents.status().message()));
}

}  // namespace tissueform
