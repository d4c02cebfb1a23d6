// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/moving_data.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <set>
#include <utility>

#include "nlohmann/json.hpp"

namespace tissueform {
namespace {

// In the order of its keys, as a browser writes it.
using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

constexpr char kMovingMagic[] = "TFMOVING";
constexpr uint32_t kMovingVersion = 1;
constexpr size_t kPartAlignment = 16;
constexpr double kStepsPerMm = 2048;
constexpr double kWeightSteps = 65535;
constexpr size_t kRowBytes = 4;

// Of each column the differences from row to row, folded so that small ones of both signs are
// small; all lowest bytes first, then all second ones: columns of zeros compress to nothing.
template <typename Rows>
std::string PackRows(const Rows& rows, double steps) {
  const auto length = static_cast<size_t>(rows.size());
  std::string out(kRowBytes * length, '\0');
  size_t at = 0;
  for (Eigen::Index k = 0; k < rows.cols(); ++k) {
    uint32_t before = 0;
    for (Eigen::Index i = 0; i < rows.rows(); ++i, ++at) {
      // Half a step away from zero goes up, as in a browser.
      const double rounded = std::floor(static_cast<double>(rows(i, k)) * steps + 0.5);
      const auto value = static_cast<uint32_t>(static_cast<int32_t>(rounded));
      const uint32_t difference = value - before;
      before = value;
      const uint32_t folded = (difference << 1) ^ (0U - (difference >> 31));
      for (size_t b = 0; b < kRowBytes; ++b) {
        out[b * length + at] = static_cast<char>(folded >> (8 * b));
      }
    }
  }
  return out;
}

Json ToJson(const Eigen::Vector3d& v) { return Json::array({v[0], v[1], v[2]}); }

Json ToJson(const HeadFrame& frame) {
  return {{"origin_mm", ToJson(frame.origin_mm)},
          {"left", ToJson(frame.left)},
          {"posterior", ToJson(frame.posterior)},
          {"superior", ToJson(frame.superior)},
          {"source", frame.source}};
}

Json ToJson(const CaseHandle& handle, bool is_free) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  return {{"name", handle.name},
          {"label", handle.label},
          {"pivot_mm", ToJson(handle.pivot_mm)},
          {"pose",
           {{"rotation_vector_deg", ToJson(kDegrees * handle.pose.rotation_vector)},
            {"pivot_mm", ToJson(handle.pose.pivot_mm)},
            {"translation_mm", ToJson(handle.pose.translation_mm)},
            {"scale", handle.pose.scale}}},
          {"limits",
           {{"translation_mm", handle.most_translation_mm},
            {"rotation_deg", handle.most_rotation_deg}}},
          {"free", is_free}};
}

// Adds what it needs to `parts`.
Json ToJson(const CaseSurface& surface, std::vector<std::string>* parts) {
  const auto add = [parts](std::string part) {
    parts->push_back(std::move(part));
    return parts->size() - 1;
  };
  Json json = {{"name", surface.name}, {"kind", SurfaceKindName(surface.kind)}};
  if (!surface.handle.empty()) json["handle"] = surface.handle;
  json["vertices"] = surface.positions.rows();
  json["triangles"] = surface.triangles.rows();
  json["positions"] = add(PackRows(surface.positions, kStepsPerMm));
  json["corners"] = add(PackRows(surface.triangles, 1));
  if (surface.follows) {
    const size_t places = add(PackRows(surface.follows->vertices, 1));
    const size_t weights = add(PackRows(surface.follows->weights, kWeightSteps));
    json["follows"] = {{"places", places}, {"weights", weights}};
  }
  return json;
}

void AppendAligned(absl::string_view part, std::string* bytes) {
  bytes->append(part.data(), part.size());
  bytes->resize((bytes->size() + kPartAlignment - 1) / kPartAlignment * kPartAlignment, '\0');
}

}  // namespace

std::vector<int32_t> FollowedVerticesOf(std::vector<CaseSurface>* surfaces) {
  std::set<int32_t> followed;
  for (const CaseSurface& surface : *surfaces) {
    if (!surface.follows) continue;
    const FollowedVertices& follows = *surface.follows;
    for (Eigen::Index i = 0; i < follows.weights.size(); ++i) {
      if (follows.weights.data()[i] > 0) followed.insert(follows.vertices.data()[i]);
    }
  }
  std::vector<int32_t> vertices(followed.begin(), followed.end());
  for (CaseSurface& surface : *surfaces) {
    if (!surface.follows) continue;
    FollowedVertices& follows = *surface.follows;
    for (Eigen::Index i = 0; i < follows.weights.size(); ++i) {
      int32_t& vertex = follows.vertices.data()[i];
      const auto place = std::lower_bound(vertices.begin(), vertices.end(), vertex);
      const bool counts = follows.weights.data()[i] > 0;
      vertex = counts ? static_cast<int32_t>(place - vertices.begin()) : 0;
    }
  }
  return vertices;
}

std::string WriteMovingData(const MovingData& data) {
  std::vector<std::string> parts;
  Json surfaces = Json::array();
  for (const CaseSurface& surface : data.surfaces) surfaces.push_back(ToJson(surface, &parts));
  Json handles = Json::array();
  for (size_t h = 0; h < data.handles.size(); ++h) {
    handles.push_back(ToJson(data.handles[h], data.handle_is_free[h]));
  }
  parts.push_back(data.answers);
  Json sizes = Json::array();
  for (const std::string& part : parts) sizes.push_back(part.size());
  const Json json = {{"format", "tissueform-moving-file"},
                     {"version", kMovingVersion},
                     {"notice", "not a medical device"},
                     {"title", data.title},
                     {"software", data.software},
                     {"model", data.model},
                     {"unit", "mm"},
                     {"coordinate_system", "LPS"},
                     {"head_frame", ToJson(data.head_frame)},
                     {"handles", handles},
                     {"surfaces", surfaces},
                     {"answers", parts.size() - 1},
                     {"parts", sizes}};
  const std::string text = json.dump();
  const std::array<uint32_t, 2> head = {kMovingVersion, static_cast<uint32_t>(text.size())};
  std::string bytes = kMovingMagic;
  bytes.append(reinterpret_cast<const char*>(head.data()), sizeof(head));
  AppendAligned(text, &bytes);
  for (const std::string& part : parts) AppendAligned(part, &bytes);
  return bytes;
}

}  // namespace tissueform
