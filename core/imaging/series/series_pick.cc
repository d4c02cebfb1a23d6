// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/series_pick.h"

#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"

#include "core/imaging/series/series_objections.h"

namespace tissueform {
namespace {

// Numbers that are read from headers and differ by less rank the same.
constexpr double kSameRankMm = 0.01;

// Lower is better.
double RankOf(const SeriesFacts& series, SeriesPreference preference) {
  switch (preference) {
    case SeriesPreference::kSoftKernel:
      return series.kernel == KernelKind::kSoft ? 0 : series.kernel == KernelKind::kUnknown ? 1 : 2;
    case SeriesPreference::kBoneKernel:
      return series.kernel == KernelKind::kBone ? 0 : series.kernel == KernelKind::kUnknown ? 1 : 2;
    case SeriesPreference::kThinSlices:
      return std::round(series.spacing_mm / kSameRankMm);
    case SeriesPreference::kNoContrast:
      return series.contrast ? 1 : 0;
    case SeriesPreference::kMoreCoverage:
      return -std::round(series.coverage_mm);
  }
  return 0;
}

const char* PreferenceWords(SeriesPreference preference) {
  switch (preference) {
    case SeriesPreference::kSoftKernel:
      return "a softer kernel";
    case SeriesPreference::kBoneKernel:
      return "a sharper kernel";
    case SeriesPreference::kThinSlices:
      return "thinner slices";
    case SeriesPreference::kNoContrast:
      return "no contrast medium";
    case SeriesPreference::kMoreCoverage:
      return "more coverage";
  }
  return "";
}

// The first preference by which they differ, and whether `first` is the better one.
struct Difference {
  bool first_is_better = false;
  std::string words = {};
};
Difference Compare(const SeriesFacts& first, const SeriesFacts& second, const SeriesRule& rule) {
  for (const SeriesPreference preference : rule.prefer) {
    const double a = RankOf(first, preference);
    const double b = RankOf(second, preference);
    if (a != b) return {a < b, PreferenceWords(preference)};
  }
  return {first.number < second.number, "a lower number"};
}

// Which of those that the rule takes it prefers.
std::optional<size_t> BestOf(const std::vector<SeriesFacts>& study,
                             const std::vector<SeriesVerdict>& verdicts, int rule_number,
                             const SeriesRule& rule) {
  std::optional<size_t> best;
  for (size_t i = 0; i < study.size(); ++i) {
    if (verdicts[i].rule != rule_number) continue;
    if (!best.has_value() || Compare(study[i], study[*best], rule).first_is_better) best = i;
  }
  return best;
}

std::string NameOfRule(const std::vector<SeriesRule>& rules, int number) {
  const std::string& name = rules[static_cast<size_t>(number)].name;
  return name.empty() ? absl::StrCat("rule ", number + 1) : absl::StrCat("rule \"", name, "\"");
}

}  // namespace

std::vector<SeriesVerdict> PickSeries(const std::vector<SeriesFacts>& study,
                                      const std::vector<SeriesRule>& rules) {
  std::vector<SeriesVerdict> verdicts(study.size());
  int best_rule = -1;
  for (size_t i = 0; i < study.size(); ++i) {
    for (int number = 0; number < static_cast<int>(rules.size()); ++number) {
      const std::string against = WhatIsAgainst(study[i], rules[static_cast<size_t>(number)]);
      if (against.empty()) {
        verdicts[i].rule = number;
        break;
      }
      // Of several rules the first one's reason: what is against all is against it, too.
      if (verdicts[i].reason.empty()) verdicts[i].reason = against;
    }
    const int taken_by = verdicts[i].rule;
    if (taken_by >= 0 && (best_rule < 0 || taken_by < best_rule)) best_rule = taken_by;
  }
  if (best_rule < 0) return verdicts;
  const SeriesRule& rule = rules[static_cast<size_t>(best_rule)];
  const std::optional<size_t> best = BestOf(study, verdicts, best_rule, rule);
  for (size_t i = 0; i < study.size(); ++i) {
    SeriesVerdict& verdict = verdicts[i];
    if (i == best) {
      verdict.chosen = true;
      verdict.reason =
          absl::StrCat("by ", NameOfRule(rules, best_rule), ": ", DescribeFacts(study[i]));
    } else if (verdict.rule == best_rule) {
      verdict.reason =
          absl::StrCat("the chosen series has ", Compare(study[*best], study[i], rule).words);
    } else if (verdict.rule >= 0) {
      verdict.reason = absl::StrCat(NameOfRule(rules, best_rule), " takes another one");
    }
  }
  return verdicts;
}

}  // namespace tissueform
