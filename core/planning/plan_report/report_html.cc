// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/report_html.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/planning/plan_report/html_text.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kHead[] = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Planning model: report</title>
<style>
:root { --ink: #1c2733; --soft: #5b6875; --line: #dde3e9; --paper: #fff; --good: #1b7f4b; --bad: #b3261e; }
body { margin: 0; background: #eef1f4; color: var(--ink); font: 16px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; }
main { max-width: 68rem; margin: 0 auto; padding: 0 1rem 3rem; }
.notice { background: #263442; color: #fff; text-align: center; padding: .5rem 1rem; margin: 0; }
h1 { font-size: 1.9rem; margin: 1.6rem 0 .3rem; }
h2 { font-size: 1.25rem; margin: 0 0 .8rem; }
section, figure { background: var(--paper); border: 1px solid var(--line); border-radius: .6rem; padding: 1.1rem 1.3rem; margin: 1rem 0; overflow-x: auto; }
.lead { color: var(--soft); margin: 0 0 1rem; }
.facts { display: flex; flex-wrap: wrap; gap: .8rem; }
.facts div { flex: 1 1 9rem; background: var(--paper); border: 1px solid var(--line); border-radius: .6rem; padding: .7rem 1rem; }
.facts b { display: block; font-size: 1.45rem; font-variant-numeric: tabular-nums; }
.facts span { color: var(--soft); font-size: .9rem; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .32rem .8rem .32rem 0; border-bottom: 1px solid var(--line); overflow-wrap: anywhere; }
th { font-weight: 500; color: var(--soft); }
th[scope=row] { width: 38%; }
.passed { color: var(--good); font-weight: 600; }
.failed { color: var(--bad); font-weight: 600; }
figure img { width: 100%; height: auto; display: block; }
figcaption { margin-top: .7rem; }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; padding: 0; margin: .5rem 0 0; font-size: .93rem; }
.legend i { display: inline-block; width: .9em; height: .9em; border-radius: .2em; margin-right: .4em; border: 1px solid rgba(0,0,0,.25); vertical-align: -.08em; }
details > summary { cursor: pointer; font-size: 1.25rem; font-weight: 700; }
@media print { body { background: #fff; } section, figure { break-inside: avoid; border: 0; padding: 0; } }
</style>
</head>
<body>
<p class="notice">Research software, not a medical device. Not for diagnosis or treatment.</p>
<main>
)";

constexpr char kFoot[] = R"(</main>
<p class="notice">Research software, not a medical device. Not for diagnosis or treatment.</p>
</body>
</html>
)";

std::string Section(const std::string& title, const std::string& content) {
  return absl::StrCat("<section>\n<h2>", EscapeHtml(title), "</h2>\n", content, "</section>\n");
}

// For those who want to look it up: closed at first.
std::string Folded(const std::string& title, const std::string& content) {
  return absl::StrCat("<section><details>\n<summary>", EscapeHtml(title), "</summary>\n", content,
                      "</details></section>\n");
}

std::string Fact(const std::string& number, const std::string& name) {
  return absl::StrCat("<div><b>", EscapeHtml(number), "</b><span>", EscapeHtml(name),
                      "</span></div>\n");
}

std::string Thousands(const Json& count) {
  return absl::StrFormat("%.1f k", count.get<double>() / 1000);
}

std::string Facts(const Json& report) {
  const double tissue_cm3 = report["soft_tissue"]["volume_mm3"].get<double>() / 1000;
  return absl::StrCat(
      "<div class=\"facts\">\n", Fact(Thousands(report["mesh"]["vertices"]), "vertices"),
      Fact(Thousands(report["mesh"]["tets"]), "tets"),
      Fact(absl::StrFormat("%.0f cm³", tissue_cm3), "soft tissue"),
      Fact(absl::StrCat(report["segments"].size()), "moved segments"),
      Fact(absl::StrFormat("%.2f mm", report["distances"]["skin_to_ct"]["mean_mm"].get<double>()),
           "mean distance of the skin to the CT's"),
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
  return report["ready"].get<bool>()
             ? "<h1>Planning model from a CT</h1>\n"
             : "<h1>Planning model from a CT: <span class=\"failed\">not ready</span></h1>\n";
}

std::string Lead(const Json& report) {
  std::string segments;
  for (const Json& segment : report["segments"]) {
    absl::StrAppend(&segments, segments.empty() ? "" : "; ", SegmentText(segment));
  }
  return absl::StrCat("<p class=\"lead\">", EscapeHtml(segments), ". Made from a CT (",
                      EscapeHtml(report["input"]["format"].get<std::string>()), ") by tissueform ",
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
  return Section(
      all ? "Quality: all requirements are met" : "Quality: not all requirements are met",
      absl::StrCat("<table>\n<tr><th scope=\"col\">requirement</th><th "
                   "scope=\"col\">required</th><th scope=\"col\">measured</th><th "
                   "scope=\"col\"></th></tr>\n",
                   rows, "</table>\n"));
}

std::string CautionsSection(const Json& cautions) {
  if (cautions.empty()) return "";
  std::string items;
  for (const Json& caution : cautions) {
    absl::StrAppend(&items, "<li>", EscapeHtml(caution.get<std::string>()), "</li>\n");
  }
  return Section("Limitations of this CT", absl::StrCat("<ul>\n", items, "</ul>\n"));
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
  return Section("Metal", JsonTable(rest) + JsonColumns(metal["pieces"]));
}

std::string LabelsSection(const Json& report) {
  const Json labels = report.value("labels", Json());
  if (!labels.is_object()) return "";
  Json rest = labels;
  for (const char* const key : {"agreement", "segments"}) rest.erase(key);
  return Section("Label map", JsonColumns(labels["agreement"]) + JsonTable(rest) +
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
  return texts.empty() ? "" : Section("Line between the lips", texts);
}

std::string Tables(const Json& report) {
  return absl::StrCat(
      Section("Segments", SegmentTables(report["segments"])),
      Section("Bone and its separation", JsonTable(report["bone"])), LabelsSection(report),
      MetalSection(report), MouthSection(report), Section("Mesh", JsonTable(report["mesh"])),
      Section("Distances", JsonTable(report["distances"])),
      Section("The CT's skin in the mesh", JsonTable(report["coverage"])),
      Section("Stiffness", StiffnessHtml(report["stiffness"])),
      Section("Fixed, moved and free", JsonTable(report["regions"])),
      Section("Head and soft tissue", JsonTable(report["head"]) + JsonTable(report["soft_tissue"])),
      Folded("Landmarks", JsonTable(report["landmarks"])),
      Folded("Planes of the region of interest", JsonTable(report["region_of_interest"])),
      Folded("Recipe, with all defaults", JsonTable(report["recipe"])),
      Section("Input and program", JsonTable(report["input"]) + JsonTable(report["program"])));
}

}  // namespace

std::string PlanReportHtml(const Json& report, const std::vector<ReportPicture>& pictures) {
  std::string html =
      absl::StrCat(kHead, Title(report), Lead(report), Facts(report),
                   QualitySection(report["quality"]), CautionsSection(report["cautions"]));
  for (const ReportPicture& picture : pictures) html += PictureHtml(picture);
  return absl::StrCat(html, Tables(report), kFoot);
}

}  // namespace tissueform
