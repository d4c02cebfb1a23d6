// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/skin_places.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/skin_region.h"

namespace tissueform {
namespace {

constexpr char kArray[] = "skin_region";

// With the number of one of the regions from `first` to `last`.
std::vector<int32_t> VerticesOf(const std::vector<double>& values, SkinRegion first,
                                SkinRegion last) {
  const auto low = static_cast<double>(first);
  const auto high = static_cast<double>(last);
  std::vector<int32_t> vertices;
  for (size_t v = 0; v < values.size(); ++v) {
    if (values[v] >= low && values[v] <= high) vertices.push_back(static_cast<int32_t>(v));
  }
  return vertices;
}

void AddUnlessEmpty(absl::string_view name, std::vector<int32_t> vertices,
                    std::vector<SkinPlace>* places) {
  if (!vertices.empty()) places->push_back({std::string(name), std::move(vertices)});
}

}  // namespace

absl::StatusOr<std::vector<SkinPlace>> SkinPlaces(const std::vector<Attribute>& point_data) {
  std::vector<SkinPlace> places;
  if (FindAttribute(point_data, kArray) == nullptr) return places;
  TF_ASSIGN_OR_RETURN(const std::vector<double> values, FindScalars(point_data, kArray, "point"));
  for (const SkinRegion region : kNamedSkinRegions) {
    AddUnlessEmpty(SkinRegionName(region), VerticesOf(values, region, region), &places);
  }
  AddUnlessEmpty("face", VerticesOf(values, kNamedSkinRegions.front(), kNamedSkinRegions.back()),
                 &places);
  return places;
}

int32_t ForemostVertex(const Positions& positions, const std::vector<int32_t>& vertices) {
  return *std::min_element(vertices.begin(), vertices.end(),
                           [&](int32_t a, int32_t b) { return positions(a, 1) < positions(b, 1); });
}

const SkinPlace* FindPlace(const std::vector<SkinPlace>& places, absl::string_view name) {
  const auto found = std::find_if(places.begin(), places.end(),
                                  [&](const SkinPlace& place) { return place.name == name; });
  return found == places.end() ? nullptr : &*found;
}

}  // namespace tissueform
