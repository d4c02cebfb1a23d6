// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/movement_table.h"

#include <algorithm>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// A bar whose first vertices are called a chin.
AccuracyCase BarWithChin() {
  AccuracyCase bar = BendCase(1).value();
  bar.places = {{"chin", {0, 3}}};
  return bar;
}

// The answers are not a model's: every vertex goes 2 mm forward and 1 mm up, vertex 3 4 mm more to
// the left.
AccuracyResult MovedAsKnown(const AccuracyCase& bar) {
  ModelAnswer answer;
  answer.name = "known";
  answer.positions = bar.mesh.positions().rowwise() + Eigen::RowVector3d(0, -2, 1);
  answer.positions(3, 0) += 4;
  AccuracyResult result;
  result.poisson_ratio = 0.3;
  result.references = {answer};
  for (const ModelVariant& variant : AllModelVariants()) {
    answer.name = variant.name;
    result.models.push_back(answer);
  }
  return result;
}

TEST(MovementTableTest, MovementIsReportedInPatientDirections) {
  const AccuracyCase bar = BarWithChin();
  CsvTable table = MovementTable();
  AddMovementRows(bar, {MovedAsKnown(bar)}, &table);
  const std::string csv = table.Csv();
  // The corner at (0, 0, 0), not vertex 3, which lies behind it; the mean is over both.
  EXPECT_THAT(csv, HasSubstr("\nbar_bend,0.3,known,chin,0,2,1,0,2.23607,2,1,2\n"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 1 + 7);
}

TEST(MovementTableTest, SummaryReportsForemostPointAndMeanOfEachModel) {
  const AccuracyCase bar = BarWithChin();
  CsvTable table = MovementSummary();
  AddMovementSummaryRows(bar, MovedAsKnown(bar), &table);
  EXPECT_THAT(table.Markdown(), HasSubstr("| bar_bend | chin | 2.00 / 1.00; 2.00 / 1.00 |"));
}

TEST(MovementTableTest, CaseWithoutPlacesAddsNothing) {
  AccuracyCase bar = BarWithChin();
  bar.places.clear();
  CsvTable table = MovementTable();
  AddMovementRows(bar, {MovedAsKnown(bar)}, &table);
  EXPECT_EQ(table.Csv(), MovementTable().Csv());
  CsvTable summary = MovementSummary();
  AddMovementSummaryRows(bar, MovedAsKnown(bar), &summary);
  EXPECT_THAT(summary.Markdown(), Not(HasSubstr("bar_bend")));
}

}  // namespace
}  // namespace tissueform
