// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/cli/outcome/outcome_json.h"
#include "core/planning/plan_report/html_text.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

std::string NameOf(const Json& prediction) {
  if (prediction["movement"] == "none") return "no prediction (pre-operative face)";
  return absl::StrCat(prediction["model"].get<std::string>(), ", ",
                      prediction["movement"].get<std::string>(), " movement");
}

// One row a prediction, one column a region.
std::string Overview(const Json& predictions, const char* key) {
  Json rows = Json::array();
  for (const Json& prediction : predictions) {
    Json row = {{"prediction", NameOf(prediction)}};
    for (const Json& region : prediction["regions"]) {
      row[region["region"].get<std::string>() + "_mm"] = region["predicted_to_real"][key];
    }
    rows.push_back(row);
  }
  return JsonColumns(rows);
}

std::string RegionTable(const Json& prediction, const char* way) {
  Json rows = Json::array();
  for (const Json& region : prediction["regions"]) {
    Json row = {{"region", region["region"]}, {"compared_share", region["compared_share"]}};
    row.update(region[way]);
    rows.push_back(row);
  }
  return JsonColumns(rows);
}

std::string Details(const Json& predictions) {
  std::string html;
  for (const Json& prediction : predictions) {
    html += HtmlFolded(
        NameOf(prediction),
        absl::StrCat("<p>From the predicted face to the operated one; positive: the "
                     "operated face is in front.</p>\n",
                     RegionTable(prediction, "predicted_to_real"),
                     "<p>From the operated face to the predicted one.</p>\n",
                     RegionTable(prediction, "real_to_predicted"),
                     "<p>Landmarks of the profile.</p>\n", JsonColumns(prediction["landmarks"])));
  }
  return html;
}

std::string SegmentTable(const Json& segments) {
  Json rows = Json::array();
  for (const Json& segment : segments) {
    for (const char* kind : {"planned", "real", "deviation"}) {
      if (!segment.contains(kind)) continue;
      Json row = {{"segment", segment["segment"]}, {"movement", kind}};
      row.update(segment[kind]);
      rows.push_back(row);
    }
  }
  Json fits = Json::array();
  for (const Json& segment : segments) {
    if (!segment.contains("rms_mm")) continue;
    fits.push_back({{"segment", segment["segment"]},
                    {"registration_rms_mm", segment["rms_mm"]},
                    {"share_used", segment["share_used"]}});
  }
  return JsonColumns(rows) + (fits.empty() ? std::string() : JsonColumns(fits));
}

std::string Cautions(const Json& cautions) {
  if (cautions.empty()) return "";
  std::string list;
  for (const Json& caution : cautions) {
    absl::StrAppend(&list, "<li>", EscapeHtml(caution.get<std::string>()), "</li>\n");
  }
  return HtmlSection("Cautions", absl::StrCat("<ul>\n", list, "</ul>\n"));
}

}  // namespace

std::string OutcomeHtml(const Json& outcome, const std::vector<std::string>& pictures) {
  std::string html = absl::StrCat(
      "<h1>Prediction and operated face</h1>\n<p class=\"lead\">Research use. How far the ",
      "predicted skin lies from the operated one, by region.</p>\n", Cautions(outcome["cautions"]));
  absl::StrAppend(
      &html,
      HtmlSection("Mean absolute distance", Overview(outcome["predictions"], "mean_absolute_mm")),
      HtmlSection("Signed mean (positive: the operated face is in front)",
                  Overview(outcome["predictions"], "mean_mm")),
      HtmlSection("90 % of the area is nearer than", Overview(outcome["predictions"], "p90_mm")));
  for (const std::string& picture : pictures) {
    absl::StrAppend(&html, "<figure><img src=\"pictures/", EscapeHtml(picture),
                    "\" alt=\"before, predicted, real, and the distances\"></figure>\n");
  }
  return HtmlPage(
      "Prediction and operated face",
      absl::StrCat(
          html, HtmlSection("Movement of the segments", SegmentTable(outcome["segments"])),
          HtmlSection("Registration of the scans", JsonTable(outcome["registration"])),
          HtmlSection("Landmarks by published ratios", JsonColumns(outcome["by_published_ratios"])),
          Details(outcome["predictions"])));
}

}  // namespace tissueform
