// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/extension_parser.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/planning/case_file/surface_parser.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Json = nlohmann::json;

// No line breaks, no escape sequences.
absl::Status CheckIsOneLine(const Json& json, const std::string& where) {
  if (json.is_string()) {
    const std::string& text = json.get_ref<const std::string&>();
    const bool has_control = std::any_of(text.begin(), text.end(), [](char c) {
      return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    });
    if (has_control) return BrokenCase(where, "contains a control character");
  }
  if (!json.is_structured()) return absl::OkStatus();
  for (const auto& [key, value] : json.items()) {
    TF_RETURN_IF_ERROR(CheckIsOneLine(value, absl::StrCat(where, "/", key)));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Json> ParseExtension(const Glb& glb, const std::string& name,
                                    const JsonSchema& schema) {
  const auto extensions = glb.root.find("extensions");
  if (extensions == glb.root.end() || !extensions->is_object() || !extensions->contains(name)) {
    return absl::InvalidArgumentError(
        absl::StrCat("not a case: a glTF file without the extension ", name));
  }
  Json ours = (*extensions)[name];
  if (const absl::Status status = schema.Check(ours); !status.ok()) {
    return absl::Status(status.code(), absl::StrCat("not a usable case: ", status.message()));
  }
  TF_RETURN_IF_ERROR(CheckIsOneLine(ours, ""));
  return ours;
}

Vector3d VectorIn(const Json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

std::string TextIn(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found == json.end() ? "" : found->get<std::string>();
}

std::vector<CaseLandmark> ParseLandmarks(const Json& json) {
  std::vector<CaseLandmark> landmarks;
  for (const Json& item : json) {
    CaseLandmark landmark{.name = TextIn(item, "name"),
                          .label = TextIn(item, "label"),
                          .position_mm = VectorIn(item["position_mm"]),
                          .handle = TextIn(item, "handle")};
    if (item.contains("skin_vertex")) landmark.skin_vertex = item["skin_vertex"].get<int32_t>();
    landmarks.push_back(std::move(landmark));
  }
  return landmarks;
}

HeadFrame ParseHeadFrame(const Json& json) {
  return {.origin_mm = VectorIn(json["origin_mm"]),
          .left = VectorIn(json["left"]),
          .posterior = VectorIn(json["posterior"]),
          .superior = VectorIn(json["superior"]),
          .source = TextIn(json, "source")};
}

absl::StatusOr<std::vector<CaseSurface>> ParseSurfaces(const Glb& glb, const Json& json,
                                                       int64_t mesh_vertices) {
  std::vector<CaseSurface> surfaces;
  // Several surfaces may name one buffer view: together they are held to what one file may hold.
  size_t bytes = 0;
  for (size_t s = 0; s < json.size(); ++s) {
    TF_ASSIGN_OR_RETURN(CaseSurface surface,
                        ParseSurface(glb, json[s], mesh_vertices, absl::StrCat("/surfaces/", s)));
    bytes += static_cast<size_t>(surface.positions.size() + surface.triangles.size()) * 4;
    if (bytes > kMaxCaseBytes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the surfaces have more than ", kMaxCaseBytes, " bytes together"));
    }
    surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

absl::Status CheckReferences(const std::vector<CaseSurface>& surfaces,
                             const std::vector<CaseLandmark>& landmarks,
                             const std::vector<std::string>& handles) {
  const auto is_known = [&](const std::string& handle) {
    return handle.empty() || std::find(handles.begin(), handles.end(), handle) != handles.end();
  };
  Index skin_vertices = 0;  // of the first skin
  for (size_t s = 0; s < surfaces.size(); ++s) {
    const std::string where = absl::StrCat("/surfaces/", s);
    const CaseSurface& surface = surfaces[s];
    if (!is_known(surface.handle)) {
      return BrokenCase(where + "/handle", "names a handle that does not exist");
    }
    if (surface.kind == SurfaceKind::kSegment && surface.handle.empty()) {
      return BrokenCase(where, "is a segment without a handle");
    }
    if (surface.kind == SurfaceKind::kSkin && skin_vertices == 0) {
      skin_vertices = surface.positions.rows();
    }
  }
  for (size_t l = 0; l < landmarks.size(); ++l) {
    const std::string where = absl::StrCat("/landmarks/", l);
    if (!is_known(landmarks[l].handle)) {
      return BrokenCase(where + "/handle", "names a handle that does not exist");
    }
    if (landmarks[l].skin_vertex && *landmarks[l].skin_vertex >= skin_vertices) {
      return BrokenCase(where + "/skin_vertex",
                        absl::StrCat("is not one of the skin's ", skin_vertices, " vertices"));
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
