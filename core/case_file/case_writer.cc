// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/case_file/case_writer.h"

#include <utility>

#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/case_file/case_reader.h"
#include "core/case_file/glb_container.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;

// glTF's names for numbers.
constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kVertexBuffer = 34962;
constexpr int kIndexBuffer = 34963;

template <typename Array>
absl::string_view CaseBytes(const Array& array) {
  return {reinterpret_cast<const char*>(array.data()),
          static_cast<size_t>(array.size()) * sizeof(*array.data())};
}

template <typename Vector>
Json VectorToJson(const Vector& v) {
  return Json::array({v[0], v[1], v[2]});
}

// What programs draw that know nothing of ours; in the order of SurfaceKind.
Json Materials() {
  const auto material = [](const char* name, double r, double g, double b) {
    return Json{
        {"name", name},
        {"doubleSided", true},
        {"pbrMetallicRoughness",
         {{"baseColorFactor", {r, g, b, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.7}}}};
  };
  return Json::array({material("skin", 0.80, 0.58, 0.47), material("bone", 0.85, 0.80, 0.68),
                      material("segment", 0.45, 0.62, 0.85), material("teeth", 0.92, 0.91, 0.86)});
}

// The accessors, mesh and node of a surface.
void AddMesh(const CaseSurface& surface, GlbWriter* writer, Json* root) {
  Json& accessors = (*root)["accessors"];
  const int first = static_cast<int>(accessors.size());
  accessors.push_back({{"bufferView", writer->AddView(CaseBytes(surface.positions), kVertexBuffer)},
                       {"componentType", kFloat},
                       {"count", surface.positions.rows()},
                       {"type", "VEC3"},
                       {"min", VectorToJson(surface.positions.colwise().minCoeff())},
                       {"max", VectorToJson(surface.positions.colwise().maxCoeff())}});
  accessors.push_back({{"bufferView", writer->AddView(CaseBytes(surface.triangles), kIndexBuffer)},
                       {"componentType", kUnsignedInt},
                       {"count", surface.triangles.size()},
                       {"type", "SCALAR"}});
  Json primitive = {{"attributes", {{"POSITION", first}}},
                    {"indices", first + 1},
                    {"material", static_cast<int>(surface.kind)}};
  const size_t mesh = (*root)["meshes"].size();
  (*root)["meshes"].push_back({{"name", surface.name}, {"primitives", Json::array({primitive})}});
  (*root)["nodes"].push_back({{"name", surface.name}, {"mesh", mesh}});
  (*root)["nodes"][0]["children"].push_back((*root)["nodes"].size() - 1);
}

Json EmptyScene() {
  Json root = {{"asset", {{"version", "2.0"}, {"generator", "tissueform"}}},
               {"scene", 0},
               {"extensionsUsed", {kCaseExtension}},
               {"materials", Materials()}};
  for (const char* key : {"accessors", "meshes", "nodes", "scenes"}) root[key] = Json::array();
  // From mm in LPS to metres with y up and the face along z; columns one after the other.
  root["nodes"].push_back(
      {{"name", "lps_mm"},
       {"matrix",
        {0.001, 0.0, 0.0, 0.0, 0.0, 0.0, -0.001, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}},
       {"children", Json::array()}});
  root["scenes"].push_back({{"nodes", Json::array({0})}});
  return root;
}

Json SurfaceToJson(const CaseSurface& surface, size_t mesh, GlbWriter* writer) {
  Json json = {{"name", surface.name}, {"kind", SurfaceKindName(surface.kind)}, {"mesh", mesh}};
  if (!surface.handle.empty()) json["handle"] = surface.handle;
  if (surface.follows) {
    const int vertices = writer->AddView(CaseBytes(surface.follows->vertices));
    const int weights = writer->AddView(CaseBytes(surface.follows->weights));
    json["follows"] = {{"vertices", vertices}, {"weights", weights}};
  }
  if (!surface.regions.empty()) json["regions"] = writer->AddView(CaseBytes(surface.regions));
  return json;
}

Json HandleToJson(const CaseHandle& handle) {
  const Vector3d rotation_deg = handle.pose.rotation_vector * (180 / M_PI);
  return {{"name", handle.name},
          {"label", handle.label},
          {"pivot_mm", VectorToJson(handle.pivot_mm)},
          {"pose",
           {{"rotation_vector_deg", VectorToJson(rotation_deg)},
            {"pivot_mm", VectorToJson(handle.pose.pivot_mm)},
            {"translation_mm", VectorToJson(handle.pose.translation_mm)},
            {"scale", handle.pose.scale}}},
          {"limits",
           {{"translation_mm", handle.most_translation_mm},
            {"rotation_deg", handle.most_rotation_deg}}}};
}

Json LandmarkToJson(const CaseLandmark& landmark) {
  Json json = {{"name", landmark.name},
               {"label", landmark.label},
               {"position_mm", VectorToJson(landmark.position_mm)}};
  if (!landmark.handle.empty()) json["handle"] = landmark.handle;
  if (landmark.skin_vertex) json["skin_vertex"] = *landmark.skin_vertex;
  return json;
}

Json HeadFrameToJson(const HeadFrame& frame) {
  return {{"origin_mm", VectorToJson(frame.origin_mm)},
          {"left", VectorToJson(frame.left)},
          {"posterior", VectorToJson(frame.posterior)},
          {"superior", VectorToJson(frame.superior)},
          {"source", frame.source}};
}

// Without what needs bytes in the file.
Json PlainKeys(const CaseFile& contents) {
  Json json = {{"format", "tissueform-case"},
               {"version", 1},
               {"title", contents.title},
               {"notice", "not a medical device"},
               {"provenance",
                {{"software", contents.software},
                 {"commit", contents.commit},
                 {"created", contents.created},
                 {"plan_sha256", contents.plan_sha256}}},
               {"unit", "mm"},
               {"coordinate_system", "LPS"},
               {"model", contents.model},
               {"head_frame", HeadFrameToJson(contents.head_frame)}};
  for (const char* key : {"surfaces", "skin_regions", "handles", "landmarks"}) {
    json[key] = Json::array();
  }
  for (const CaseSkinRegion& region : contents.skin_regions) {
    json["skin_regions"].push_back(
        {{"number", region.number}, {"name", region.name}, {"label", region.label}});
  }
  for (const CaseHandle& handle : contents.handles) json["handles"].push_back(HandleToJson(handle));
  for (const CaseLandmark& landmark : contents.landmarks) {
    json["landmarks"].push_back(LandmarkToJson(landmark));
  }
  return json;
}

}  // namespace

absl::StatusOr<std::string> SerializeCase(const CaseFile& contents) {
  GlbWriter writer;
  Json root = EmptyScene();
  Json ours = PlainKeys(contents);
  // The order of the bytes is part of the format: a viewer reads the beginning only.
  for (const CaseSurface& surface : contents.surfaces) AddMesh(surface, &writer, &root);
  for (size_t s = 0; s < contents.surfaces.size(); ++s) {
    ours["surfaces"].push_back(SurfaceToJson(contents.surfaces[s], s, &writer));
  }
  ours["session_request"] = writer.AddView(contents.session_request);
  if (contents.material_ranges) {
    ours["material_ranges"] = writer.AddView(*contents.material_ranges);
  }
  ours["mesh"] = {{"name", contents.mesh.name},
                  {"vertex_count", contents.mesh.vertex_count},
                  {"tet_count", contents.mesh.tet_count},
                  {"cell_arrays", contents.mesh.cell_arrays},
                  {"payload", writer.AddView(contents.mesh.payload)}};
  root["extensions"][kCaseExtension] = std::move(ours);
  std::string bytes = writer.Finish(std::move(root));
  TF_RETURN_IF_ERROR(ParseCase(bytes).status());
  return bytes;
}

}  // namespace tissueform
