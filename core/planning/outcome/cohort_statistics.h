// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace tissueform {

// Statistics of a cohort: one number a patient. Pure functions; the same numbers give the same
// result on every machine.

struct Interval {
  double low = 0;
  double high = 0;
};

// Resamples of a bootstrap.
inline constexpr int kBootstrapResamples = 2000;

// The percentile bootstrap of the mean, 95 %: the 2.5th and the 97.5th percentile (nearest rank) of
// the means of kBootstrapResamples resamples. The seed is fixed. Too narrow for fewer than about 20
// values.
//
// REQUIRES: at least two values.
Interval BootstrapMean(const std::vector<double>& values);

// Of distances in mm, one a patient.
struct CohortSummary {
  size_t n = 0;
  double mean_mm = 0;
  double sd_mm = 0;                  // with n - 1; 0 of one patient
  std::optional<Interval> interval;  // BootstrapMean; empty of one patient
  double median_mm = 0;
  double p90_mm = 0;      // nearest rank
  double within_1mm = 0;  // share of patients, in [0, 1]
  double within_2mm = 0;
};

// REQUIRES: at least one distance, none of them NaN.
CohortSummary SummarizeCohort(const std::vector<double>& distances_mm);

// Wilcoxon's signed rank test of paired differences, two-sided.
struct SignedRankTest {
  size_t n = 0;         // of differences that are not 0: the others are left out
  double rank_sum = 0;  // the smaller of the sums of positive and of negative ranks
  double p = 1;
  bool exact = false;  // the distribution of the rank sum; else the normal approximation
};

// Exact for up to 25 differences without ties and zeros. Else the normal approximation with
// correction for ties and without correction for continuity, as scipy.stats.wilcoxon has it. Equal
// numbers are ties: round differences to what they are known to.
//
// p = 1 where every difference is 0. REQUIRES: no NaN.
SignedRankTest TestSignedRanks(const std::vector<double>& differences);

// Agreement of two measurements (Bland and Altman 1986): the mean of their differences, and between
// which limits 95 % of the differences lie where they are normally distributed.
struct Agreement {
  size_t n = 0;
  double bias = 0;
  double sd = 0;    // with n - 1
  double low = 0;   // bias - 1.96 sd
  double high = 0;  // bias + 1.96 sd
};

// REQUIRES: at least two differences.
Agreement AgreementOf(const std::vector<double>& differences);

// The setting (column) with the smallest mean of `errors`, #patients by #settings; the first of
// equals. REQUIRES: at least one patient and one setting, no NaN.
Eigen::Index BestSetting(const Eigen::MatrixXd& errors);

// Leave-one-out cross-validation: for each patient the best setting of all others, so that no
// patient's error counts where a setting is chosen for that patient.
//
// REQUIRES: as BestSetting, and at least two patients.
std::vector<Eigen::Index> BestSettingsOfOthers(const Eigen::MatrixXd& errors);

}  // namespace tissueform
