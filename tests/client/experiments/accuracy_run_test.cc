// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/accuracy_run.h"

#include <algorithm>
#include <filesystem>

#include "client/experiments/accuracy_table.h"
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
                           [this](const std::string& line) { told_ += line + "\n"; });
  }

  const AccuracyCase bend_ = BendCase(2).value();
  // One for each test: tests run at the same time.
  const std::string folder_ = ::testing::TempDir() + "/accuracy_run_test." +
                              ::testing::UnitTest::GetInstance()->current_test_info()->name();
  std::string told_;
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
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 6 * 2 * 2);
  EXPECT_THAT(csv,
              StartsWith("case,nu,model,reference,region,mean_mm,p50_mm,p90_mm,p95_mm,max_mm"));
  EXPECT_THAT(csv, HasSubstr("\nbar_bend,0.3,arap,calculix_neo_hookean,skin,"));
}

TEST_F(AccuracyRunTest, MissingProgramEndsTheRun) {
  const testing::ScopedEnvironment no_programs("PATH", "/nonexistent");
  EXPECT_TRUE(absl::IsNotFound(Run({0.3}).status()));
}

TEST_F(AccuracyRunTest, ReferenceThatIsNotFoundIsToldOfAndLeftOut) {
  std::filesystem::create_symlink("/bin/false", folder_ + "/ccx");
  const testing::ScopedEnvironment programs("PATH", folder_.c_str());
  ASSERT_OK_AND_ASSIGN(const auto results, Run({0.3}));
  EXPECT_TRUE(results[0].references.empty());
  EXPECT_EQ(results[0].Reference("calculix_linear"), nullptr);
  EXPECT_EQ(results[0].models.size(), AllModelVariants().size());
  EXPECT_THAT(told_, HasSubstr("bar_bend, nu = 0.3: ccx failed"));
}

}  // namespace
}  // namespace tissueform
