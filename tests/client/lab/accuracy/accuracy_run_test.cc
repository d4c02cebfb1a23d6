// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_run.h"

#include <algorithm>
#include <filesystem>

#include "client/lab/accuracy/accuracy_table.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class AccuracyRunTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<std::vector<AccuracyResult>> Run(const std::vector<double>& poisson_ratios) {
    return RunAccuracyCase(bend_, poisson_ratios, folder_,
                           [this](const std::string& line) { reported_ += line + "\n"; });
  }

  const AccuracyCase bend_ = BendCase(2).value();
  // One for each test: tests run at the same time.
  const std::string folder_ = ::testing::TempDir() + "/accuracy_run_test." +
                              ::testing::UnitTest::GetInstance()->current_test_info()->name();
  std::string reported_;
};

TEST_F(AccuracyRunTest, EveryModelAnswersAndOnlyElasticOnesDependOnPoissonsRatio) {
  ASSERT_OK_AND_ASSIGN(const auto results, Run({0.0, 0.45}));
  ASSERT_EQ(results.size(), 2U);
  for (const ModelVariant& variant : AllModelVariants()) {
    const ModelAnswer* low = results[0].Model(variant.name);
    const ModelAnswer* high = results[1].Model(variant.name);
    ASSERT_NE(low, nullptr);
    ASSERT_NE(high, nullptr);
    EXPECT_EQ(low->positions != high->positions, variant.uses_poisson_ratio) << variant.name;
  }
}

TEST_F(AccuracyRunTest, TableHasARowForEachModelReferenceAndRegion) {
  ASSERT_OK_AND_ASSIGN(const auto results, Run({0.3}));
  CsvTable table = AccuracyTable();
  AddAccuracyRows(bend_, results, &table);
  const std::string csv = table.Csv();
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 7 * 2 * 2);
  EXPECT_THAT(
      csv, StartsWith("case,nu,model,reference,region,mean_mm,p50_mm,p90_mm,p95_mm,p99_mm,max_mm"));
  EXPECT_THAT(csv, HasSubstr("\nbar_bend,0.3,arap,calculix_neo_hookean,skin,"));
}

// Answers that are no model's, so that every figure is known: all vertices lie as the reference has
// them but one of the chin, which is 3 mm off.
TEST_F(AccuracyRunTest, SkinPlacesHaveOwnRowsAndReportExceededDistances) {
  AccuracyCase bend = bend_;
  bend.places = {{"chin", {0, 1, 2, 3}}, {"nose", {4, 5}}};
  AccuracyResult result;
  result.poisson_ratio = 0.3;
  result.references = {{"calculix_neo_hookean", bend.mesh.positions() * 1.5}};
  for (const ModelVariant& variant : AllModelVariants()) {
    result.models.push_back({variant.name, result.references[0].positions});
    result.models.back().positions(2, 1) += 3;
  }
  CsvTable table = AccuracyTable();
  AddAccuracyRows(bend, {result}, &table);
  const std::string csv = table.Csv();
  EXPECT_THAT(csv, HasSubstr("\nbar_bend,0.3,arap,calculix_neo_hookean,chin,0.75,0,3,3,3,3,"));
  EXPECT_THAT(csv, HasSubstr(",yes,4,1\n"));
  EXPECT_THAT(csv, HasSubstr("\nbar_bend,0.3,arap,calculix_neo_hookean,nose,0,0,0,0,0,0,"));
  EXPECT_THAT(csv, HasSubstr(",yes,2,0\n"));
  CsvTable summary = PlaceSummary();
  AddPlaceSummaryRows(bend, result, &summary);
  EXPECT_THAT(summary.Markdown(), HasSubstr("| bar_bend | chin | 4 | 0.00 / 3.00 / 3.00 / 3.00 |"));
}

TEST_F(AccuracyRunTest, MissingProgramEndsTheRun) {
  const testing::ScopedEnvironment no_programs("PATH", "/nonexistent");
  EXPECT_TRUE(absl::IsNotFound(Run({0.3}).status()));
}

TEST_F(AccuracyRunTest, MissingReferenceIsReportedAndLeftOut) {
  std::filesystem::create_symlink("/bin/false", folder_ + "/ccx");
  const testing::ScopedEnvironment programs("PATH", folder_.c_str());
  ASSERT_OK_AND_ASSIGN(const auto results, Run({0.3}));
  EXPECT_TRUE(results[0].references.empty());
  EXPECT_EQ(results[0].Reference("calculix_linear"), nullptr);
  EXPECT_EQ(results[0].models.size(), AllModelVariants().size());
  EXPECT_THAT(reported_, HasSubstr("bar_bend, nu = 0.3: ccx failed"));
}

}  // namespace
}  // namespace tissueform
