// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/report_html.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/planning/plan_report/html_text.h"
#include "core/planning/plan_report/input_words.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

std::string Fact(const std::string& number, const std::string& name) {
  return absl::StrCat("<div><b>", EscapeHtml(number), "</b><span>", EscapeHtml(name),
                      "</span></div>\n");
}

std::string Thousands(const Json& count) {
  return absl::StrFormat("%.1f k", count.get<double>() / 1000);
}

InputWords WordsOf(const Json& report) {
  return report["input"].contains("surfaces") ? WordsOfSurfaces() : InputWords();
}

std::string Facts(const Json& report) {
  const InputWords words = WordsOf(report);
  const char* const distance = words.of_surfaces ? "skin_to_surfaces" : "skin_to_ct";
  const double tissue_cm3 = report["soft_tissue"]["volume_mm3"].get<double>() / 1000;
  return absl::StrCat(
      "<div class=\"facts\">\n", Fact(Thousands(report["mesh"]["vertices"]), "vertices"),
      Fact(Thousands(report["mesh"]["tets"]), "tets"),
      Fact(absl::StrFormat("%.0f cm³", tissue_cm3), "soft tissue"),
      Fact(absl::StrCat(report["segments"].size()), "moved segments"),
      Fact(absl::StrFormat("%.2f mm", report["distances"][distance]["mean_mm"].get<double>()),
           absl::StrCat("mean distance of the skin ", words.to_skin)),
      "</div>\n");
}

// "mandible (bssro, 21.3 cm³), moved by 6 mm and turned by 3°"
std::string SegmentText(const Json& segment) {
  const auto length = [&segment](const char* key) {
    double square = 0;
    for (const double entry : segment["pose"][key]) square += entry * entry;
    return std::sqrt(square);
  };
  std::string text =
      absl::StrFormat("%s (%s, %.1f cm³), moved by %.3g mm", segment["name"].get<std::string>(),
                      segment["osteotomy"].get<std::string>(),
                      segment["volume_mm3"].get<double>() / 1000, length("translation_mm"));
  if (const double turn_deg = length("rotation_vector_deg"); turn_deg > 0) {
    absl::StrAppendFormat(&text, " and turned by %.3g°", turn_deg);
  }
  return text;
}

std::string Title(const Json& report) {
  return absl::StrCat(
      "<h1>Planning model from ", WordsOf(report).a_source,
      report["ready"].get<bool>() ? "" : ": <span class=\"failed\">not ready</span>", "</h1>\n");
}

// "DICOM", or the surfaces by their roles.
std::string SourceText(const Json& input) {
  if (!input.contains("surfaces")) return input["format"];
  return absl::StrJoin(input["surfaces"].get<std::vector<std::string>>(), ", ");
}

std::string Lead(const Json& report) {
  std::string segments;
  for (const Json& segment : report["segments"]) {
    absl::StrAppend(&segments, segments.empty() ? "" : "; ", SegmentText(segment));
  }
  return absl::StrCat("<p class=\"lead\">", EscapeHtml(segments), ". Made from ",
                      WordsOf(report).a_source, " (", EscapeHtml(SourceText(report["input"])),
                      ") by tissueform ",
                      EscapeHtml(report["program"]["tissueform"].get<std::string>()), ".</p>\n");
}

std::string QualitySection(const Json& checks) {
  std::string rows;
  bool all = true;
  for (const Json& check : checks) {
    const bool passed = check["passed"];
    all = all && passed;
    absl::StrAppend(&rows, "<tr><td>", EscapeHtml(check["requirement"].get<std::string>()),
                    "</td><td>", EscapeHtml(check["required"].get<std::string>()), "</td><td>",
                    EscapeHtml(check["measured"].get<std::string>()), "</td><td class=\"",
                    passed ? "passed\">✓ met" : "failed\">✗ not met", "</td></tr>\n");
  }
  return HtmlSection(
      all ? "Quality: all requirements are met" : "Quality: not all requirements are met",
      absl::StrCat("<table>\n<tr><th scope=\"col\">requirement</th><th "
                   "scope=\"col\">required</th><th scope=\"col\">measured</th><th "
                   "scope=\"col\"></th></tr>\n",
                   rows, "</table>\n"));
}

std::string CautionsSection(const Json& report) {
  const Json& cautions = report["cautions"];
  if (cautions.empty()) return "";
  std::string items;
  for (const Json& caution : cautions) {
    absl::StrAppend(&items, "<li>", EscapeHtml(caution.get<std::string>()), "</li>\n");
  }
  return HtmlSection(absl::StrCat("Limitations of ", WordsOf(report).this_source),
                     absl::StrCat("<ul>\n", items, "</ul>\n"));
}

std::string LegendHtml(const std::vector<LegendEntry>& legend) {
  if (legend.empty()) return "";
  std::string items;
  for (const LegendEntry& entry : legend) {
    const Eigen::Vector3d channels = 255 * entry.colour;
    absl::StrAppend(
        &items, absl::StrFormat("<li><i style=\"background:rgb(%.0f,%.0f,%.0f)\"></i>%s</li>\n",
                                channels.x(), channels.y(), channels.z(), EscapeHtml(entry.name)));
  }
  return absl::StrCat("<ul class=\"legend\">\n", items, "</ul>\n");
}

std::string PictureHtml(const ReportPicture& picture) {
  return absl::StrCat("<figure>\n<h2>", EscapeHtml(picture.title), "</h2>\n<img src=\"pictures/",
                      EscapeHtml(picture.file), "\" alt=\"",
                      EscapeHtml(absl::StrCat(picture.title, ". ", picture.caption)), "\">\n",
                      "<figcaption>", EscapeHtml(picture.caption), "\n", LegendHtml(picture.legend),
                      "</figcaption>\n</figure>\n");
}

std::string SegmentTables(const Json& segments) {
  std::string tables;
  for (const Json& segment : segments) tables += JsonTable(segment);
  return tables;
}

std::string StiffnessHtml(const Json& stiffness) {
  Json rest = stiffness;
  rest.erase("tissues");
  return JsonColumns(stiffness["tissues"]) + JsonTable(rest);
}

std::string MetalSection(const Json& report) {
  const Json metal = report.value("metal", Json::object());
  if (!metal.value("found", false)) return "";
  Json rest = metal;
  rest.erase("pieces");
  return HtmlSection("Metal", JsonTable(rest) + JsonColumns(metal["pieces"]));
}

std::string ValuesSection(const Json& report) {
  const Json values = report.value("values", Json());
  return values.is_object() ? HtmlSection("Values and field of view", JsonTable(values)) : "";
}

std::string LabelsSection(const Json& report) {
  const Json labels = report.value("labels", Json());
  if (!labels.is_object()) return "";
  Json rest = labels;
  for (const char* const key : {"agreement", "segments"}) rest.erase(key);
  return HtmlSection("Label map", JsonColumns(labels["agreement"]) + JsonTable(rest) +
                                      JsonColumns(labels["segments"]));
}

// The sentences; the points are for programs.
std::string MouthSection(const Json& report) {
  std::string texts;
  for (const char* const key : {"mouth_line", "lip_contact"}) {
    if (!report.contains(key) || !report[key].is_object()) continue;
    for (const Json& text : report[key].value("says", Json::array())) {
      absl::StrAppend(&texts, "<p>", EscapeHtml(text.get<std::string>()), "</p>\n");
    }
  }
  return texts.empty() ? "" : HtmlSection("Line between the lips", texts);
}

std::string Tables(const Json& report) {
  return absl::StrCat(
      HtmlSection("Segments", SegmentTables(report["segments"])),
      HtmlSection("Bone and its separation", JsonTable(report["bone"])), ValuesSection(report),
      LabelsSection(report), MetalSection(report), MouthSection(report),
      HtmlSection("Mesh", JsonTable(report["mesh"])),
      HtmlSection("Distances", JsonTable(report["distances"])),
      HtmlSection(absl::StrCat(Capitalized(WordsOf(report).the_skin), " in the mesh"),
                  JsonTable(report["coverage"])),
      HtmlSection("Stiffness", StiffnessHtml(report["stiffness"])),
      HtmlSection("Fixed, moved and free", JsonTable(report["regions"])),
      HtmlSection("Head and soft tissue",
                  JsonTable(report["head"]) + JsonTable(report["soft_tissue"])),
      HtmlFolded("Landmarks", JsonTable(report["landmarks"])),
      HtmlFolded("Planes of the region of interest", JsonTable(report["region_of_interest"])),
      HtmlFolded("Recipe, with all defaults", JsonTable(report["recipe"])),
      HtmlSection("Input and program", JsonTable(report["input"]) + JsonTable(report["program"])));
}

}  // namespace

std::string PlanReportHtml(const Json& report, const std::vector<ReportPicture>& pictures) {
  std::string html = absl::StrCat(Title(report), Lead(report), Facts(report),
                                  QualitySection(report["quality"]), CautionsSection(report));
  for (const ReportPicture& picture : pictures) html += PictureHtml(picture);
  return HtmlPage("Planning model: report", html + Tables(report));
}

}  // namespace tissueform
