// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/html_text.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(HtmlTextTest, NothingOfATextIsMarkup) {
  EXPECT_EQ(EscapeHtml("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
  EXPECT_EQ(EscapeHtml("16 ± 5 kPa"), "16 ± 5 kPa");
}

TEST(HtmlTextTest, KeysBecomeWordsWithTheirUnit) {
  EXPECT_EQ(LabelOfKey("left_out_mm3"), "left out [mm³]");
  EXPECT_EQ(LabelOfKey("edge_mm"), "edge [mm]");
  EXPECT_EQ(LabelOfKey("vertices"), "vertices");
  EXPECT_EQ(LabelOfKey("<b>"), "&lt;b&gt;");
}

TEST(HtmlTextTest, TableHasARowForEveryValue) {
  const auto object = nlohmann::ordered_json::parse(
      R"({"tets": 1234567, "ratio": 0.98765432, "source": "<i>", "skin": {"mean_mm": 0.25},
          "planes": [{"normal": [0, 0, 1]}], "notes": [], "flag": true})");
  EXPECT_EQ(JsonTable(object),
            "<table>\n"
            "<tr><th scope=\"row\">tets</th><td>1,234,567</td></tr>\n"
            "<tr><th scope=\"row\">ratio</th><td>0.9877</td></tr>\n"
            "<tr><th scope=\"row\">source</th><td>&lt;i&gt;</td></tr>\n"
            "<tr><th scope=\"row\">skin: mean [mm]</th><td>0.25</td></tr>\n"
            "<tr><th scope=\"row\">planes 1: normal</th><td>0, 0, 1</td></tr>\n"
            "<tr><th scope=\"row\">notes</th><td>none</td></tr>\n"
            "<tr><th scope=\"row\">flag</th><td>yes</td></tr>\n"
            "</table>\n");
}

TEST(HtmlTextTest, LongListsAreLeftToTheJsonFile) {
  const nlohmann::ordered_json object = {{"counts", std::vector<int>(24, 77)}};
  EXPECT_THAT(JsonTable(object),
              AllOf(HasSubstr("24 numbers, see report.json"), Not(HasSubstr("77"))));
}

TEST(HtmlTextTest, RowsWithFewerKeysHaveEmptyCells) {
  const auto list = nlohmann::ordered_json::parse(R"([{"b": 1}, {"a": -1000, "b": 2}])");
  EXPECT_EQ(JsonColumns(list),
            "<table>\n<tr><th scope=\"col\">a</th><th scope=\"col\">b</th></tr>\n"
            "<tr><td></td><td>1</td></tr>\n<tr><td>-1,000</td><td>2</td></tr>\n</table>\n");
}

}  // namespace
}  // namespace tissueform
