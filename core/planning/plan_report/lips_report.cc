// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/lips_report.h"

#include "absl/strings/str_format.h"

#include "core/planning/json_values.h"

namespace tissueform {
namespace {

// A tube, a thread of saliva or the blur between lips that just touch is narrower.
constexpr double kLeastWidthMm = 5;

}  // namespace

nlohmann::ordered_json LipsJson(const LipContact& contact, bool parted) {
  nlohmann::ordered_json json = {{"examined_mm", contact.examined_mm},
                                 {"joined_mm", contact.width_mm},
                                 {"joined_mm2", contact.area_mm2},
                                 {"joined_depth_mm", contact.depth_mm}};
  if (contact.width_mm > 0) json["joined_at_mm"] = ToJson(contact.place_mm);
  json["joined_means"] =
      absl::StrCat("along the middle of the mouth, where no air separates the lips: the model ",
                   parted ? "parts them along the mouth line"
                          : "treats them as one piece of tissue, which neither opens nor slides");
  return json;
}

std::vector<std::string> LipsCautions(const LipContact& contact, const InputWords& words) {
  if (contact.width_mm < kLeastWidthMm) return {};
  return {absl::StrFormat(
      "The lips are closed in %s and one piece of tissue in the model: over %.0f of the "
      "middle "
      "%.0f mm of the mouth, %.0f mm deep on average (%.0f mm2), about (%.0f, %.0f, %.0f) mm. They "
      "move together: opening, and sliding of one on the other, are not predicted.",
      words.this_source, contact.width_mm, contact.examined_mm, contact.depth_mm, contact.area_mm2,
      contact.place_mm.x(), contact.place_mm.y(), contact.place_mm.z())};
}

}  // namespace tissueform
