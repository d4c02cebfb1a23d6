// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/surface_parser.h"

#include <array>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Json = nlohmann::json;

constexpr int kFloatComponents = 5126;
constexpr int kIndexComponents = 5125;
constexpr int kTriangles = 4;
// Rounding of three float32 that sum to one.
constexpr float kWeightTolerance = 1e-5F;
constexpr size_t kMaxAccessors = 256;

// All rows that the view holds. `rows`: how many there must be.
template <typename Scalar>
absl::Status FillRows(absl::string_view bytes, Index rows, const std::string& where,
                      Eigen::Matrix<Scalar, Eigen::Dynamic, 3, Eigen::RowMajor>* matrix) {
  constexpr size_t kRowBytes = 3 * sizeof(Scalar);
  if (bytes.size() % kRowBytes != 0 || static_cast<Index>(bytes.size() / kRowBytes) != rows) {
    return BrokenCase(where, absl::StrCat("has ", bytes.size(), " bytes where ", rows, " times ",
                                          kRowBytes, " belong"));
  }
  matrix->resize(rows, 3);
  std::memcpy(matrix->data(), bytes.data(), bytes.size());
  return absl::OkStatus();
}

// What an accessor stands for, of which ours use all of a buffer view.
struct Numbers {
  absl::string_view bytes;
  int64_t count = 0;
};
absl::StatusOr<Numbers> ParseAccessor(const Glb& glb, const Json& holder, const char* key,
                                      int component_type, const char* type,
                                      const std::string& where) {
  TF_ASSIGN_OR_RETURN(const std::vector<Json> all,
                      Objects(glb.root, "accessors", kMaxAccessors, ""));
  TF_ASSIGN_OR_RETURN(const int64_t number,
                      WholeNumber(holder, key, 0, static_cast<int64_t>(all.size()) - 1, where));
  const Json& accessor = all[static_cast<size_t>(number)];
  const std::string at = absl::StrCat("/accessors/", number);
  TF_RETURN_IF_ERROR(
      WholeNumber(accessor, "componentType", component_type, component_type, at).status());
  if (accessor.value("type", Json()) != type || accessor.contains("sparse") ||
      accessor.contains("byteOffset")) {
    return BrokenCase(at, absl::StrCat("is not a ", type, " of a whole buffer view"));
  }
  TF_ASSIGN_OR_RETURN(const int64_t count,
                      WholeNumber(accessor, "count", 1, std::numeric_limits<int32_t>::max(), at));
  TF_RETURN_IF_ERROR(
      WholeNumber(accessor, "bufferView", 0, static_cast<int64_t>(glb.views.size()) - 1, at)
          .status());
  return Numbers{glb.views[accessor.at("bufferView").get<size_t>()], count};
}

absl::StatusOr<Json> OnlyPrimitive(const Glb& glb, size_t mesh, const std::string& where) {
  TF_ASSIGN_OR_RETURN(const std::vector<Json> meshes, Objects(glb.root, "meshes", 64, ""));
  if (mesh >= meshes.size()) return BrokenCase(where + "/mesh", "names a mesh that does not exist");
  const std::string at = absl::StrCat("/meshes/", mesh);
  TF_ASSIGN_OR_RETURN(const std::vector<Json> primitives,
                      Objects(meshes[mesh], "primitives", 1, at));
  if (primitives.size() != 1 || !primitives[0].contains("attributes") ||
      !primitives[0]["attributes"].is_object() ||
      primitives[0].value("mode", Json(kTriangles)) != kTriangles) {
    return BrokenCase(at, "must have exactly one primitive, of triangles");
  }
  return primitives[0];
}

absl::Status ParseTriangles(const Glb& glb, size_t mesh, const std::string& where,
                            CaseSurface* surface) {
  TF_ASSIGN_OR_RETURN(const Json primitive, OnlyPrimitive(glb, mesh, where));
  const std::string at = absl::StrCat("/meshes/", mesh, "/primitives/0");
  TF_ASSIGN_OR_RETURN(
      const Numbers positions,
      ParseAccessor(glb, primitive["attributes"], "POSITION", kFloatComponents, "VEC3", at));
  TF_ASSIGN_OR_RETURN(const Numbers indices,
                      ParseAccessor(glb, primitive, "indices", kIndexComponents, "SCALAR", at));
  if (indices.count > 3 * kMaxSurfaceTriangles) {
    return absl::ResourceExhaustedError(absl::StrCat(where, " has ", indices.count / 3,
                                                     " triangles; at most ", kMaxSurfaceTriangles,
                                                     " are read"));
  }
  if (indices.count % 3 != 0) return BrokenCase(at, "has indices that do not form triangles");
  TF_RETURN_IF_ERROR(FillRows(positions.bytes, positions.count, at, &surface->positions));
  // Numbers of 2^31 and more become negative ones, which are refused as well.
  TF_RETURN_IF_ERROR(FillRows(indices.bytes, indices.count / 3, at, &surface->triangles));
  if (!surface->positions.allFinite()) return BrokenCase(where, "contains NaN or infinity");
  if (surface->triangles.minCoeff() < 0 || surface->triangles.maxCoeff() >= positions.count) {
    return BrokenCase(where, absl::StrCat("names a vertex outside its ", positions.count));
  }
  return absl::OkStatus();
}

absl::Status ParseFollows(const Glb& glb, const Json& json, int64_t mesh_vertices,
                          const std::string& where, CaseSurface* surface) {
  FollowedVertices follows;
  const Index rows = surface->positions.rows();
  TF_ASSIGN_OR_RETURN(const absl::string_view vertices, ViewOf(glb, json, "vertices", where));
  TF_ASSIGN_OR_RETURN(const absl::string_view weights, ViewOf(glb, json, "weights", where));
  TF_RETURN_IF_ERROR(FillRows(vertices, rows, where + "/vertices", &follows.vertices));
  TF_RETURN_IF_ERROR(FillRows(weights, rows, where + "/weights", &follows.weights));
  if (follows.vertices.minCoeff() < 0 || follows.vertices.maxCoeff() >= mesh_vertices) {
    return BrokenCase(where + "/vertices",
                      absl::StrCat("names a vertex outside the mesh's ", mesh_vertices));
  }
  if (!follows.weights.allFinite() || follows.weights.minCoeff() < 0 ||
      follows.weights.rowwise().sum().maxCoeff() > 1 + kWeightTolerance) {
    return BrokenCase(where + "/weights", "has weights below 0, or with a sum above 1");
  }
  surface->follows = std::move(follows);
  return absl::OkStatus();
}

SurfaceKind KindOf(const Json& name) {
  for (const SurfaceKind kind : {SurfaceKind::kBone, SurfaceKind::kSegment, SurfaceKind::kTeeth}) {
    if (name == SurfaceKindName(kind)) return kind;
  }
  return SurfaceKind::kSkin;
}

}  // namespace

const char* SurfaceKindName(SurfaceKind kind) {
  static constexpr std::array<const char*, 4> kNames = {"skin", "bone", "segment", "teeth"};
  return kNames[static_cast<size_t>(kind)];
}

absl::Status BrokenCase(absl::string_view where, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("not a usable case: ", where, " ", what));
}

absl::StatusOr<absl::string_view> ViewOf(const Glb& glb, const Json& json, const char* key,
                                         const std::string& where) {
  const size_t number = json.at(key).get<size_t>();
  if (number < glb.views.size()) return glb.views[number];
  return BrokenCase(absl::StrCat(where, "/", key), "names a buffer view that does not exist");
}

absl::StatusOr<CaseSurface> ParseSurface(const Glb& glb, const Json& json, int64_t mesh_vertices,
                                         const std::string& where) {
  CaseSurface surface;
  surface.name = json["name"].get<std::string>();
  surface.kind = KindOf(json["kind"]);
  surface.handle = json.value("handle", "");
  TF_RETURN_IF_ERROR(ParseTriangles(glb, json["mesh"].get<size_t>(), where, &surface));
  if (json.contains("follows")) {
    TF_RETURN_IF_ERROR(
        ParseFollows(glb, json["follows"], mesh_vertices, where + "/follows", &surface));
  }
  if (json.contains("regions")) {
    TF_ASSIGN_OR_RETURN(const absl::string_view regions, ViewOf(glb, json, "regions", where));
    if (static_cast<Index>(regions.size()) != surface.positions.rows()) {
      return BrokenCase(where + "/regions", "must have one byte per vertex");
    }
    surface.regions.assign(regions.begin(), regions.end());
  }
  return surface;
}

}  // namespace tissueform
