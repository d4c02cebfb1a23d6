// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/cohort_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <Eigen/Core>
#include <sys/wait.h>

#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

constexpr int kMissing = 77;

// Of 3 to 200 values, with and without ties and zeros; differences, so some are negative.
std::vector<std::vector<double>> Samples() {
  std::mt19937 random(5);
  std::vector<std::vector<double>> samples;
  for (const size_t n : {3, 4, 7, 12, 24, 25, 26, 60, 200}) {
    for (const double grain : {1e-9, 0.1, 0.5}) {
      std::normal_distribution<double> value(0.3, 1);
      std::vector<double>& sample = samples.emplace_back();
      for (size_t i = 0; i < n; ++i) sample.push_back(std::round(value(random) / grain) * grain);
    }
  }
  return samples;
}

TEST(CohortStatisticsTest, AreThoseOfScipy) {
  const std::vector<std::vector<double>> samples = Samples();
  const std::string folder = ::testing::TempDir();
  const std::string given = folder + "/cohort_samples.json";
  const std::string found = folder + "/cohort_scipy.json";
  std::ofstream(given) << nlohmann::json(samples).dump();
  const std::string script =
      testing::SourcePath("tests/core/planning/outcome/statistics_of_scipy.py");
  const int status = std::system(
      absl::StrCat(TISSUEFORM_PYTHON, " -B ", script, " ", given, " > ", found).c_str());
  ASSERT_NE(WEXITSTATUS(status), kMissing) << "python3-scipy is missing: deploy/packages.txt";
  ASSERT_EQ(status, 0);
  const auto scipy = nlohmann::json::parse(std::ifstream(found));
  ASSERT_EQ(scipy.size(), samples.size());
  for (size_t s = 0; s < samples.size(); ++s) {
    SCOPED_TRACE(absl::StrCat("sample ", s));
    const auto& theirs = scipy[s];
    const CohortSummary ours = SummarizeCohort(samples[s]);
    EXPECT_NEAR(ours.mean_mm, theirs["mean"], 1e-12);
    EXPECT_NEAR(ours.sd_mm, theirs["sd"], 1e-12);
    EXPECT_NEAR(ours.median_mm, theirs["median"], 1e-12);
    EXPECT_NEAR(ours.p90_mm, theirs["p90"], 1e-12);
    const SignedRankTest test = TestSignedRanks(samples[s]);
    EXPECT_EQ(test.exact, theirs["exact"]);
    EXPECT_NEAR(test.rank_sum, theirs["rank_sum"], 1e-9);
    EXPECT_NEAR(test.p, theirs["p"], 1e-9);
    // A 2.5th percentile of 2,000 normal means is known to sqrt(0.025 0.975 / 2000) / density =
    // 0.06 standard errors; four of these, and the steps of few values.
    const double close =
        (samples[s].size() < 12 ? 0.5 : 0.25) * theirs["standard_error"].get<double>();
    EXPECT_NEAR(ours.interval->low, theirs["low"], close);
    EXPECT_NEAR(ours.interval->high, theirs["high"], close);
  }
}

TEST(CohortStatisticsTest, AMeansIntervalHoldsTheTruthNineteenTimesInTwenty) {
  std::mt19937 random(8);
  std::normal_distribution<double> value(1.2, 0.5);
  int held = 0;
  constexpr int kCohorts = 200;
  for (int c = 0; c < kCohorts; ++c) {
    std::vector<double> cohort(40);
    for (double& distance : cohort) distance = value(random);
    const Interval interval = BootstrapMean(cohort);
    if (interval.low <= 1.2 && 1.2 <= interval.high) ++held;
  }
  EXPECT_GT(held, 0.90 * kCohorts);
  EXPECT_LT(held, 0.99 * kCohorts);
}

TEST(CohortStatisticsTest, SharesCountPatients) {
  const CohortSummary summary = SummarizeCohort({0.5, 1.0, 1.5, 2.5});
  EXPECT_DOUBLE_EQ(summary.within_1mm, 0.5);
  EXPECT_DOUBLE_EQ(summary.within_2mm, 0.75);
}

TEST(CohortStatisticsTest, OnePatientHasNoSpread) {
  const CohortSummary summary = SummarizeCohort({0.7});
  EXPECT_EQ(summary.sd_mm, 0);
  EXPECT_FALSE(summary.interval.has_value());
}

TEST(CohortStatisticsTest, ModelsThatAgreeEverywhereDoNotDiffer) {
  const SignedRankTest test = TestSignedRanks({0, 0, 0});
  EXPECT_EQ(test.n, 0U);
  EXPECT_EQ(test.p, 1);
}

// Five of five in one direction: 2 of 32 signs are as extreme.
TEST(CohortStatisticsTest, FiveOfFiveIsAP) {
  const SignedRankTest test = TestSignedRanks({1, 2, 3, 4, 5});
  EXPECT_TRUE(test.exact);
  EXPECT_DOUBLE_EQ(test.p, 2.0 / 32);
}

TEST(CohortStatisticsTest, LimitsOfAgreementAreRoundTheBias) {
  const Agreement agreement = AgreementOf({1, 2, 3});
  EXPECT_DOUBLE_EQ(agreement.bias, 2);
  EXPECT_DOUBLE_EQ(agreement.sd, 1);
  EXPECT_NEAR(agreement.low, 0.04, 1e-12);
  EXPECT_NEAR(agreement.high, 3.96, 1e-12);
}

Eigen::MatrixXd RandomErrors(std::mt19937* random, Eigen::Index patients, Eigen::Index settings) {
  std::uniform_real_distribution<double> error(0.2, 1.5);
  return Eigen::MatrixXd::NullaryExpr(patients, settings, [&] { return error(*random); });
}

TEST(CalibrationTest, EachPatientGetsTheSettingWithTheSmallestMeanOfTheOthers) {
  std::mt19937 random(11);
  const Eigen::MatrixXd errors = RandomErrors(&random, 9, 7);
  const std::vector<Eigen::Index> chosen = BestSettingsOfOthers(errors);
  ASSERT_EQ(chosen.size(), 9U);
  for (Eigen::Index patient = 0; patient < 9; ++patient) {
    double least = 1e9;
    Eigen::Index best = -1;
    for (Eigen::Index setting = 0; setting < 7; ++setting) {
      double sum = 0;
      for (Eigen::Index other = 0; other < 9; ++other) {
        if (other != patient) sum += errors(other, setting);
      }
      if (sum / 8 < least) best = setting;
      least = std::min(least, sum / 8);
    }
    EXPECT_EQ(chosen[static_cast<size_t>(patient)], best) << "patient " << patient;
  }
}

TEST(CalibrationTest, APatientsOwnErrorDoesNotCount) {
  std::mt19937 random(12);
  const Eigen::MatrixXd errors = RandomErrors(&random, 6, 5);
  const std::vector<Eigen::Index> chosen = BestSettingsOfOthers(errors);
  for (Eigen::Index patient = 0; patient < 6; ++patient) {
    for (Eigen::Index setting = 0; setting < 5; ++setting) {
      Eigen::MatrixXd changed = errors;
      changed(patient, setting) = -100;
      const auto at = static_cast<size_t>(patient);
      EXPECT_EQ(BestSettingsOfOthers(changed)[at], chosen[at]);
    }
  }
}

// Settings that do not matter: what is fitted to all patients looks better than it is, what is
// cross-validated does not.
TEST(CalibrationTest, NoiseIsNotReportedAsAGain) {
  std::mt19937 random(13);
  double fitted = 0;
  double validated = 0;
  constexpr int kCohorts = 400;
  constexpr Eigen::Index kPatients = 12;
  for (int c = 0; c < kCohorts; ++c) {
    const Eigen::MatrixXd errors = RandomErrors(&random, kPatients, 20);
    const std::vector<Eigen::Index> chosen = BestSettingsOfOthers(errors);
    fitted += errors.col(BestSetting(errors)).mean() / kCohorts;
    for (Eigen::Index p = 0; p < kPatients; ++p) {
      validated += errors(p, chosen[static_cast<size_t>(p)]) / kPatients / kCohorts;
    }
  }
  EXPECT_NEAR(validated, 0.85, 0.02);
  EXPECT_LT(fitted, 0.70);
}

TEST(CalibrationTest, EqualSettingsLeaveThePlans) {
  EXPECT_EQ(BestSetting(Eigen::MatrixXd::Constant(4, 3, 0.5)), 0);
}

}  // namespace
}  // namespace tissueform
