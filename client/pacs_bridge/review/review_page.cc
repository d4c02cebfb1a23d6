// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/review_page.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "client/pacs_bridge/review/shown_text.h"

namespace tissueform {
namespace {

constexpr size_t kMaxPicturesShown = 8;
std::string Cell(const std::string& text) {
  return absl::StrCat("<td>", text.empty() ? "&ndash;" : EscapedHtml(text), "</td>");
}

const char* WordsOf(SeriesState state) {
  switch (state) {
    case SeriesState::kReceiving:
      return "being received";
    case SeriesState::kIncomplete:
      return "incomplete";
    case SeriesState::kComplete:
      return "complete";
    case SeriesState::kPassedOver:
      return "not chosen";
    case SeriesState::kChosen:
      return "plan is being built";
    case SeriesState::kBuilt:
    case SeriesState::kPacked:
      return "plan built";
    case SeriesState::kPublished:
      return "ready to plan";
    case SeriesState::kFailed:
      return "failed";
    case SeriesState::kDrafting:
      return "is sent to the planner";
    case SeriesState::kDraft:
      return "waits in the planner for a plan";
  }
  return "";
}

const char* WordsOf(BridgeExportState state) {
  switch (state) {
    case BridgeExportState::kAsked:
      return "waits for confirmation";
    case BridgeExportState::kConfirmed:
    case BridgeExportState::kFetched:
    case BridgeExportState::kWritten:
      return "is being stored";
    case BridgeExportState::kSent:
    case BridgeExportState::kReported:
      return "stored";
    case BridgeExportState::kFailed:
      return "failed";
  }
  return "";
}

std::string PlannerLink(const std::string& planner_url, const std::string& case_name) {
  if (planner_url.empty() || case_name.empty()) return {};
  return absl::StrCat("<a href=\"", EscapedHtml(planner_url),
                      "#case=", EscapedHtml(absl::StripPrefix(case_name, "cases/")),
                      "\">Open in the planner</a>");
}

std::string DraftLink(const std::string& planner_url, const std::string& draft) {
  if (planner_url.empty() || draft.empty()) return {};
  return absl::StrCat("<a href=\"", EscapedHtml(planner_url),
                      "#new&amp;draft=", EscapedHtml(absl::StripPrefix(draft, "buildDrafts/")),
                      "\">Plan it</a>");
}

std::string PatientList(const QueuedStudy& study) {
  const auto item = [](const char* term, const std::string& text) {
    return absl::StrCat(
        "<div><dt>", term, "</dt><dd>",
        text.empty() ? "<span class=\"problem\">not given</span>" : EscapedHtml(text),
        "</dd></div>");
  };
  return absl::StrCat("<dl>", item("Name", ShownName(study.patient.name)),
                      item("Born", ShownDate(study.patient.birth_date)),
                      item("Patient ID", study.patient.id), item("Study of", ShownDate(study.date)),
                      item("Study", study.description), "</dl>");
}

std::string Pictures(const ReviewExport& waiting) {
  std::string html;
  for (size_t i = 0; i < std::min(waiting.pictures.size(), kMaxPicturesShown); ++i) {
    absl::StrAppend(&html, "<img src=\"/pictures/", waiting.queued.key, "/",
                    EscapedHtml(waiting.pictures[i]), "\" alt=\"", "The predicted face, picture ",
                    i + 1, "\" loading=\"lazy\">");
  }
  return html.empty() ? html : absl::StrCat("<div class=\"pictures\">", html, "</div>");
}

std::string ConfirmForm(const ReviewExport& waiting, const std::string& form_token) {
  return absl::StrCat(
      "<form method=\"post\" action=\"/store\"><input type=\"hidden\" name=\"token\" value=\"",
      EscapedHtml(form_token), "\"><input type=\"hidden\" name=\"export\" value=\"",
      EscapedHtml(waiting.queued.name), "\"><input type=\"hidden\" name=\"patient\" value=\"",
      DigestOf(waiting.of.study.patient),
      "\"><button type=\"submit\">Store in the PACS of this patient</button></form>");
}

std::string ExportArticle(const ReviewExport& waiting, const ReviewPageOptions& options) {
  const bool asked = waiting.queued.state == BridgeExportState::kAsked;
  std::string html = absl::StrCat("<article class=\"", asked ? "waits" : "", "\"><h3>Prediction ",
                                  WordsOf(waiting.queued.state), "</h3>");
  if (!waiting.queued.note.empty()) {
    absl::StrAppend(&html, "<p class=\"problem\" role=\"alert\">", EscapedHtml(waiting.queued.note),
                    "</p>");
  }
  if (asked && !waiting.of.study.patient.readable) {
    absl::StrAppend(&html,
                    "<p class=\"problem\" role=\"alert\">A text of this patient could not be "
                    "decoded: compare with the PACS before you store.</p>");
  }
  absl::StrAppend(&html, PatientList(waiting.of.study), Pictures(waiting));
  const std::string link = PlannerLink(options.planner_url, waiting.queued.case_name);
  if (!link.empty()) absl::StrAppend(&html, "<p>", link, "</p>");
  if (asked) absl::StrAppend(&html, ConfirmForm(waiting, options.form_token));
  if (!waiting.queued.last_error.empty()) {
    absl::StrAppend(
        &html, "<p class=\"quiet\">Last attempt: ", EscapedHtml(waiting.queued.last_error), "</p>");
  }
  return absl::StrCat(html, "</article>");
}

std::string SeriesRow(const ReviewSeries& row, const ReviewPageOptions& options) {
  const std::string& why =
      row.series.last_error.empty() ? row.series.reason : row.series.last_error;
  return absl::StrCat("<tr><th scope=\"row\">", EscapedHtml(ShownName(row.study.patient.name)),
                      "</th>", Cell(ShownDate(row.study.patient.birth_date)),
                      Cell(row.study.patient.id), Cell(ShownDate(row.study.date)),
                      Cell(row.study.description), "<td>", WordsOf(row.series.state),
                      why.empty() ? "" : absl::StrCat("<br><small>", EscapedHtml(why), "</small>"),
                      "</td><td>",
                      row.series.state == SeriesState::kPublished
                          ? PlannerLink(options.planner_url, row.series.case_name)
                          : DraftLink(options.planner_url, row.draft),
                      "</td></tr>");
}

}  // namespace

std::string ReviewPage(const ReviewQueue& list, const ReviewPageOptions& options) {
  std::string html =
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>Review page - Tissueform</title><link rel=\"stylesheet\" href=\"/style.css\"></head>"
      "<body><header><h1>Review page</h1><p class=\"quiet\">Research software, not a medical "
      "device.</p><p><a href=\"/\">Refresh</a></p></header><main>";
  if (!options.notice.empty()) {
    absl::StrAppend(&html, "<p role=\"status\" class=\"notice",
                    options.notice_is_problem ? " problem" : "", "\">", EscapedHtml(options.notice),
                    "</p>");
  }
  absl::StrAppend(&html,
                  "<section aria-labelledby=\"exports\"><h2 id=\"exports\">Predictions for "
                  "the PACS</h2>");
  if (list.exports.empty())
    absl::StrAppend(&html, "<p class=\"quiet\">No predictions are waiting.</p>");
  for (const ReviewExport& waiting : list.exports) {
    absl::StrAppend(&html, ExportArticle(waiting, options));
  }
  absl::StrAppend(&html,
                  "</section><section aria-labelledby=\"cases\"><h2 id=\"cases\">Cases</h2>");
  if (list.series.empty()) {
    absl::StrAppend(&html, "<p class=\"quiet\">Nothing received yet.</p>");
  } else {
    absl::StrAppend(&html,
                    "<div class=\"wide\" role=\"region\" aria-labelledby=\"cases\" "
                    "tabindex=\"0\"><table><thead><tr><th scope=\"col\">Name</th>"
                    "<th scope=\"col\">Born</th><th scope=\"col\">Patient ID</th>"
                    "<th scope=\"col\">Study of</th><th scope=\"col\">Study</th>"
                    "<th scope=\"col\">State</th><th scope=\"col\">Plan</th></tr></thead><tbody>");
    for (const ReviewSeries& row : list.series) absl::StrAppend(&html, SeriesRow(row, options));
    absl::StrAppend(&html, "</tbody></table></div>");
  }
  if (list.passed_over > 0) {
    absl::StrAppend(&html, "<p class=\"quiet\">", list.passed_over,
                    " other series were received but not chosen: <code>tissueform-pacs "
                    "series</code> says why.</p>");
  }
  return absl::StrCat(html, "</section></main></body></html>\n");
}

}  // namespace tissueform
