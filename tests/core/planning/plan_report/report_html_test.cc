// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/report_html.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kAttack[] = "<script>alert(1)</script>\"'";

nlohmann::ordered_json SmallReport(bool passed) {
  return nlohmann::ordered_json{
      {"ready", passed},
      {"quality",
       {{{"requirement", kAttack}, {"required", kAttack}, {"measured", "1"}, {"passed", passed}}}},
      {"cautions", {kAttack}},
      {"program", {{"tissueform", kAttack}}},
      {"input", {{"format", kAttack}, {"notes", {kAttack}}}},
      {"head", {{"removed_mm3", 1.0}}},
      {"bone", {{"separation", kAttack}}},
      {"landmarks", {{"unit", "mm"}}},
      {"segments",
       {{{"name", kAttack},
         {"osteotomy", kAttack},
         {"volume_mm3", 1000.0},
         {"pose",
          {{"translation_mm", {0.0, -3.0, 4.0}}, {"rotation_vector_deg", {2.0, 0.0, 0.0}}}}}}},
      {"region_of_interest", {{"from", kAttack}}},
      {"soft_tissue", {{"volume_mm3", 5.0}}},
      {"mesh", {{"vertices", 1500}, {"tets", 6000}}},
      {"distances", {{"skin_to_ct", {{"mean_mm", 0.25}}}}},
      {"coverage", {{"means", kAttack}}},
      {"stiffness", {{"tissues", {{{"name", kAttack}, {"source", kAttack}}}}}},
      {"regions", {{kAttack, 1}}},
      {"recipe", {{"name", kAttack}}}};
}

TEST(ReportHtmlTest, NoTextOfTheReportIsMarkup) {
  const ReportPicture picture{kAttack, kAttack, kAttack, {{kAttack, kBlue}}};
  const std::string html = PlanReportHtml(SmallReport(true), {picture});
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<script")), HasSubstr("&lt;script&gt;"),
                          Not(HasSubstr(")\"'")), Not(HasSubstr("http"))));
}

TEST(ReportHtmlTest, CautionsHaveASectionIfThereAreAny) {
  nlohmann::ordered_json report = SmallReport(true);
  report["cautions"] = {"no nose", "no chin"};
  EXPECT_THAT(PlanReportHtml(report, {}), AllOf(HasSubstr("Limitations of this CT"),
                                                HasSubstr("<li>no nose</li>\n<li>no chin")));
  report["cautions"] = nlohmann::ordered_json::array();
  EXPECT_THAT(PlanReportHtml(report, {}), Not(HasSubstr("Limitations of this CT")));
}

TEST(ReportHtmlTest, HeadingsNameTheSourceOfThePlan) {
  nlohmann::ordered_json report = SmallReport(false);
  EXPECT_THAT(PlanReportHtml(report, {}),
              AllOf(HasSubstr("<h1>Planning model from a CT: <span class=\"failed\">not ready"),
                    HasSubstr("Made from a CT ("), HasSubstr("mean distance of the skin to the CT"),
                    HasSubstr("The CT&#39;s skin in the mesh")));
  report["input"] = {{"format", "surfaces"}, {"surfaces", {"skin", "lower jaw", kAttack}}};
  report["distances"] = {{"skin_to_surfaces", {{"mean_mm", 0.25}}}};
  EXPECT_THAT(
      PlanReportHtml(report, {}),
      AllOf(HasSubstr("<h1>Planning model from surfaces: <span class=\"failed\">not ready</span>"),
            HasSubstr("Made from surfaces (skin, lower jaw, &lt;script&gt;"),
            HasSubstr("0.25 mm</b><span>mean distance of the skin to the given skin"),
            HasSubstr("Limitations of these surfaces"), HasSubstr("The given skin in the mesh"),
            Not(ContainsRegex("[^A-Z]CT[^A-Z]")), Not(HasSubstr("<script"))));
}

TEST(ReportHtmlTest, TheMouthLineIsDescribedInWords) {
  nlohmann::ordered_json report = SmallReport(true);
  report["mouth_line"] = {{"says", {kAttack, "the left corner is unsure"}}, {"points_mm", {1234}}};
  EXPECT_THAT(PlanReportHtml(report, {}),
              AllOf(HasSubstr("Line between the lips"), HasSubstr("<p>the left corner is unsure"),
                    Not(HasSubstr("<script")), Not(HasSubstr("1234"))));
}

TEST(ReportHtmlTest, PageListsMetRequirementsAndTheMedicalDeviceNotice) {
  const std::string good = PlanReportHtml(SmallReport(true), {});
  EXPECT_THAT(good, AllOf(HasSubstr("all requirements are met"), Not(HasSubstr("not met")),
                          HasSubstr("moved by 5 mm and turned by 2°")));
  EXPECT_THAT(good, Not(HasSubstr("not ready")));
  EXPECT_THAT(PlanReportHtml(SmallReport(false), {}),
              AllOf(HasSubstr("not met"), HasSubstr("not ready")));
  const std::string notice = "not a medical device";
  EXPECT_LT(good.find(notice), good.find("<h1>"));
  EXPECT_GT(good.rfind(notice), good.rfind("</section>"));
}

}  // namespace
}  // namespace tissueform
