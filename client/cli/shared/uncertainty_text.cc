// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/uncertainty_text.h"

#include "absl/strings/str_format.h"

namespace tissueform {

using OrderedJson = nlohmann::ordered_json;

OrderedJson MaterialBandToJson(const MaterialBand& band) {
  OrderedJson json = {{"notice", kMaterialUncertaintyNotice},
                      {"places", OrderedJson::array()},
                      {"causes", OrderedJson::array()}};
  for (const MaterialBand::Place& place : band.places) {
    json["places"].push_back({{"name", place.name},
                              {"vertices", place.vertices},
                              {"mean_mm", place.mean_mm},
                              {"p95_mm", place.p95_mm},
                              {"max_mm", place.max_mm}});
  }
  for (const MaterialBand::Cause& cause : band.causes) {
    json["causes"].push_back({{"name", cause.name}, {"mean_mm", cause.mean_mm}});
  }
  return json;
}

std::string MaterialBandText(const MaterialBand& band) {
  if (band.places.empty()) return "material uncertainty: the surface has no free vertices";
  const MaterialBand::Place& place = band.places.back();
  return absl::StrFormat(
      "material uncertainty (%s), 95 %% interval: +-%.3f mm on the %s on average, %.3f mm "
      "at most",
      kMaterialUncertaintyNotice, place.mean_mm, place.name, place.max_mm);
}

std::string LargestBandText(double largest_mm) {
  return absl::StrFormat(
      "material uncertainty (%s), 95 %% interval: at most +-%.3f mm on the "
      "skin",
      kMaterialUncertaintyNotice, largest_mm);
}

}  // namespace tissueform
