// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/case_writer.h"

#include <cmath>
#include <utility>

#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/scene_writer.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

Json HandleToJson(const CaseHandle& handle) {
  const Eigen::Vector3d rotation_deg = handle.pose.rotation_vector * (180 / M_PI);
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

// Without what needs bytes in the file.
Json PlainKeys(const CaseFile& contents) {
  Json json = {{"format", "tissueform-case"},
               {"version", contents.contact ? 2 : 1},
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
               {"landmarks", LandmarksToJson(contents.landmarks)},
               {"head_frame", HeadFrameToJson(contents.head_frame)},
               {"skin_regions", Json::array()},
               {"handles", Json::array()}};
  for (const CaseSkinRegion& region : contents.skin_regions) {
    json["skin_regions"].push_back(
        {{"number", region.number}, {"name", region.name}, {"label", region.label}});
  }
  for (const CaseHandle& handle : contents.handles) json["handles"].push_back(HandleToJson(handle));
  return json;
}

}  // namespace

absl::StatusOr<std::string> SerializeCase(const CaseFile& contents) {
  SceneWriter writer;
  Json ours = PlainKeys(contents);
  // The order of the bytes is part of the format: a viewer reads the beginning only.
  ours["surfaces"] = writer.AddSurfaces(contents.surfaces);
  ours["session_request"] = writer.AddBytes(contents.session_request);
  if (contents.material_ranges) {
    ours["material_ranges"] = writer.AddBytes(*contents.material_ranges);
  }
  if (contents.contact) {
    const auto& sticking = contents.contact->sticking;
    const absl::string_view bytes(reinterpret_cast<const char*>(sticking.data()),
                                  static_cast<size_t>(sticking.size()) * sizeof(int32_t));
    ours["contact"] = {{"rows", contents.contact->rows}};
    if (!bytes.empty()) ours["contact"]["sticking"] = writer.AddBytes(bytes);
  }
  ours["mesh"] = {{"name", contents.mesh.name},
                  {"vertex_count", contents.mesh.vertex_count},
                  {"tet_count", contents.mesh.tet_count},
                  {"cell_arrays", contents.mesh.cell_arrays},
                  {"payload", writer.AddBytes(contents.mesh.payload)}};
  std::string bytes = writer.Finish(kCaseExtension, std::move(ours));
  TF_RETURN_IF_ERROR(ParseCase(bytes).status());
  return bytes;
}

}  // namespace tissueform
