// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/scene_writer.h"

#include <utility>

namespace tissueform {
namespace {

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

Json RowToJson(const Eigen::RowVector3f& row) {
  return VectorToJson(row.transpose().cast<double>());
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

Json EmptyScene() {
  Json root = {{"asset", {{"version", "2.0"}, {"generator", "tissueform"}}},
               {"scene", 0},
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

}  // namespace

SceneWriter::SceneWriter() : root_(EmptyScene()) {}

// An accessor each for positions and triangles, a mesh and a node.
void SceneWriter::AddMesh(const CaseSurface& surface) {
  Json& accessors = root_["accessors"];
  const int first = static_cast<int>(accessors.size());
  accessors.push_back({{"bufferView", writer_.AddView(CaseBytes(surface.positions), kVertexBuffer)},
                       {"componentType", kFloat},
                       {"count", surface.positions.rows()},
                       {"type", "VEC3"},
                       {"min", RowToJson(surface.positions.colwise().minCoeff())},
                       {"max", RowToJson(surface.positions.colwise().maxCoeff())}});
  accessors.push_back({{"bufferView", writer_.AddView(CaseBytes(surface.triangles), kIndexBuffer)},
                       {"componentType", kUnsignedInt},
                       {"count", surface.triangles.size()},
                       {"type", "SCALAR"}});
  Json primitive = {{"attributes", {{"POSITION", first}}},
                    {"indices", first + 1},
                    {"material", static_cast<int>(surface.kind)}};
  const size_t mesh = root_["meshes"].size();
  root_["meshes"].push_back({{"name", surface.name}, {"primitives", Json::array({primitive})}});
  root_["nodes"].push_back({{"name", surface.name}, {"mesh", mesh}});
  root_["nodes"][0]["children"].push_back(root_["nodes"].size() - 1);
}

nlohmann::json SceneWriter::AddSurfaces(const std::vector<CaseSurface>& surfaces) {
  const size_t first = root_["meshes"].size();
  for (const CaseSurface& surface : surfaces) AddMesh(surface);
  Json json = Json::array();
  for (size_t s = 0; s < surfaces.size(); ++s) {
    json.push_back(SurfaceToJson(surfaces[s], first + s, &writer_));
  }
  return json;
}

std::string SceneWriter::Finish(const std::string& extension, Json ours) {
  root_["extensionsUsed"] = Json::array({extension});
  root_["extensions"][extension] = std::move(ours);
  return writer_.Finish(root_);
}

Json VectorToJson(const Eigen::Vector3d& v) { return Json::array({v[0], v[1], v[2]}); }

Json LandmarksToJson(const std::vector<CaseLandmark>& landmarks) {
  Json all = Json::array();
  for (const CaseLandmark& landmark : landmarks) {
    Json json = {{"name", landmark.name},
                 {"label", landmark.label},
                 {"position_mm", VectorToJson(landmark.position_mm)}};
    if (!landmark.handle.empty()) json["handle"] = landmark.handle;
    if (landmark.skin_vertex) json["skin_vertex"] = *landmark.skin_vertex;
    all.push_back(std::move(json));
  }
  return all;
}

Json HeadFrameToJson(const HeadFrame& frame) {
  return {{"origin_mm", VectorToJson(frame.origin_mm)},
          {"left", VectorToJson(frame.left)},
          {"posterior", VectorToJson(frame.posterior)},
          {"superior", VectorToJson(frame.superior)},
          {"source", frame.source}};
}

}  // namespace tissueform
