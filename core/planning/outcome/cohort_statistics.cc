// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/cohort_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <random>

#include "core/base/percentiles.h"

namespace tissueform {
namespace {

constexpr uint32_t kBootstrapSeed = 20261128;
constexpr size_t kMaxExact = 25;
constexpr double kLimitsOfAgreement = 1.96;  // standard deviations

double MeanOf(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double StandardDeviation(const std::vector<double>& values, double mean) {
  if (values.size() < 2) return 0;
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

double ShareWithin(const std::vector<double>& values, double limit) {
  const auto within = std::ranges::count_if(values, [&](double value) { return value <= limit; });
  return static_cast<double>(within) / static_cast<double>(values.size());
}

// The sums of ranks of absolute differences by sign. Ties get the mean of their ranks.
struct RankSums {
  double positive = 0;
  double negative = 0;
  double ties = 0;  // sum of t^3 - t over groups of t equal ranks
};

// `differences` rise by their absolute value.
RankSums SumRanks(const std::vector<double>& differences) {
  RankSums sums;
  for (size_t begin = 0, end = 0; begin < differences.size(); begin = end) {
    while (end < differences.size() && std::abs(differences[end]) == std::abs(differences[begin])) {
      ++end;
    }
    const double rank = static_cast<double>(begin + 1 + end) / 2;
    const auto count = static_cast<double>(end - begin);
    sums.ties += count * count * count - count;
    for (size_t i = begin; i < end; ++i)
      (differences[i] > 0 ? sums.positive : sums.negative) += rank;
  }
  return sums;
}

// Each of the 2^n signs is equally likely: counts those whose positive ranks sum to at most
// `rank_sum`.
double ExactP(size_t n, double rank_sum) {
  std::vector<double> ways(n * (n + 1) / 2 + 1, 0.0);  // by sum of positive ranks
  ways[0] = 1;
  for (size_t rank = 1; rank <= n; ++rank) {
    for (size_t sum = ways.size() - 1; sum >= rank; --sum) ways[sum] += ways[sum - rank];
  }
  const auto last = static_cast<std::ptrdiff_t>(rank_sum) + 1;
  const double below = std::accumulate(ways.begin(), ways.begin() + last, 0.0);
  return std::min(1.0, 2 * below / std::exp2(static_cast<double>(n)));
}

double ApproximateP(size_t count, double rank_sum, double ties) {
  const auto n = static_cast<double>(count);
  const double mean = n * (n + 1) / 4;
  const double variance = (n * (n + 1) * (2 * n + 1) - ties / 2) / 24;
  if (variance <= 0) return 1;
  return std::erfc(std::abs(rank_sum - mean) / std::sqrt(variance) / std::numbers::sqrt2);
}

}  // namespace

Interval BootstrapMean(const std::vector<double>& values) {
  // A multiplication instead of std::uniform_int_distribution, which differs between libraries.
  std::mt19937 random(kBootstrapSeed);
  const auto count = static_cast<uint64_t>(values.size());
  std::vector<double> means(kBootstrapResamples);
  for (double& mean : means) {
    double sum = 0;
    for (uint64_t i = 0; i < count; ++i) sum += values[(uint64_t{random()} * count) >> 32];
    mean = sum / static_cast<double>(count);
  }
  std::ranges::sort(means);
  return {PercentileOfRising(means, 2.5), PercentileOfRising(means, 97.5)};
}

CohortSummary SummarizeCohort(const std::vector<double>& distances_mm) {
  CohortSummary summary;
  summary.n = distances_mm.size();
  summary.mean_mm = MeanOf(distances_mm);
  summary.sd_mm = StandardDeviation(distances_mm, summary.mean_mm);
  if (summary.n > 1) summary.interval = BootstrapMean(distances_mm);
  summary.median_mm = Median(distances_mm);
  summary.p90_mm = Percentile(distances_mm, 90);
  summary.within_1mm = ShareWithin(distances_mm, 1);
  summary.within_2mm = ShareWithin(distances_mm, 2);
  return summary;
}

SignedRankTest TestSignedRanks(const std::vector<double>& differences) {
  std::vector<double> used;
  std::ranges::copy_if(differences, std::back_inserter(used), [](double d) { return d != 0; });
  std::ranges::sort(used, {}, [](double d) { return std::abs(d); });
  SignedRankTest test;
  test.n = used.size();
  if (used.empty()) return test;
  const RankSums sums = SumRanks(used);
  test.rank_sum = std::min(sums.positive, sums.negative);
  test.exact = test.n <= kMaxExact && test.n == differences.size() && sums.ties == 0;
  test.p =
      test.exact ? ExactP(test.n, test.rank_sum) : ApproximateP(test.n, test.rank_sum, sums.ties);
  return test;
}

Agreement AgreementOf(const std::vector<double>& differences) {
  Agreement agreement;
  agreement.n = differences.size();
  agreement.bias = MeanOf(differences);
  agreement.sd = StandardDeviation(differences, agreement.bias);
  agreement.low = agreement.bias - kLimitsOfAgreement * agreement.sd;
  agreement.high = agreement.bias + kLimitsOfAgreement * agreement.sd;
  return agreement;
}

Eigen::Index BestSetting(const Eigen::MatrixXd& errors) {
  Eigen::Index best = 0;
  errors.colwise().sum().minCoeff(&best);
  return best;
}

std::vector<Eigen::Index> BestSettingsOfOthers(const Eigen::MatrixXd& errors) {
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index patient = 0; patient < errors.rows(); ++patient) {
    Eigen::MatrixXd others = errors;
    others.row(patient).setZero();
    chosen.push_back(BestSetting(others));
  }
  return chosen;
}

}  // namespace tissueform
