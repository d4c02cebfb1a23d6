// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/skin_places.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/base/status_macros.h"
#include "core/planning/array_lookup.h"

namespace tissueform {
namespace {

constexpr char kArray[] = "skin_region";
// By the value in the array; 0 is no place.
constexpr std::array<const char*, 7> kNames = {"",     "upper_lip",  "lower_lip",  "chin",
                                               "nose", "cheek_left", "cheek_right"};

std::vector<int32_t> VerticesWith(const std::vector<double>& values, double low, double high) {
  std::vector<int32_t> vertices;
  for (size_t v = 0; v < values.size(); ++v) {
    if (values[v] >= low && values[v] <= high) vertices.push_back(static_cast<int32_t>(v));
  }
  return vertices;
}

void AddUnlessEmpty(std::string name, std::vector<int32_t> vertices,
                    std::vector<SkinPlace>* places) {
  if (!vertices.empty()) places->push_back({std::move(name), std::move(vertices)});
}

}  // namespace

absl::StatusOr<std::vector<SkinPlace>> SkinPlaces(const std::vector<Attribute>& point_data) {
  std::vector<SkinPlace> places;
  if (std::none_of(point_data.begin(), point_data.end(),
                   [](const Attribute& array) { return array.name == kArray; })) {
    return places;
  }
  TF_ASSIGN_OR_RETURN(const std::vector<double> values, FindScalars(point_data, kArray, "point"));
  for (size_t label = 1; label < kNames.size(); ++label) {
    const auto value = static_cast<double>(label);
    AddUnlessEmpty(kNames.at(label), VerticesWith(values, value, value), &places);
  }
  AddUnlessEmpty("face", VerticesWith(values, 1, static_cast<double>(kNames.size() - 1)), &places);
  return places;
}

int32_t ForemostVertex(const Positions& positions, const SkinPlace& place) {
  return *std::min_element(place.vertices.begin(), place.vertices.end(),
                           [&](int32_t a, int32_t b) { return positions(a, 1) < positions(b, 1); });
}

const SkinPlace* FindPlace(const std::vector<SkinPlace>& places, const std::string& name) {
  const auto found = std::find_if(places.begin(), places.end(),
                                  [&](const SkinPlace& place) { return place.name == name; });
  return found == places.end() ? nullptr : &*found;
}

}  // namespace tissueform
