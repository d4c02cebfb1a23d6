// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/cli/outcome/cohort_results.h"
#include "client/cli/outcome/cohort_tables.h"
#include "client/cli/outcome/outcome_json.h"
#include "core/base/software_version.h"
#include "core/planning/outcome/cohort_statistics.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kTogether[] = "all operations";
constexpr char kBaseline[] = "none";

// Values with their names in the order of first appearance, as models and regions are listed in
// each case.
template <typename Rows, typename NameOf>
std::vector<std::string> NamesIn(const Rows& rows, const NameOf& name_of) {
  std::vector<std::string> names;
  for (const auto& row : rows) {
    const std::string& name = name_of(row);
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  return names;
}

// The distances of one group and region, by case.
using ByCase = std::map<std::string, const CohortDistance*>;

// By region and model.
using ByPrediction = std::map<std::pair<std::string, std::string>, ByCase>;

// Of one operation and movement; the baseline is of every movement.
ByPrediction Gather(const CohortResults& results, const std::string& operation,
                    const std::string& movement) {
  ByPrediction gathered;
  for (const CohortDistance& distance : results.distances) {
    const CohortGroup& group = distance.group;
    if (!IsOf(group.operation, operation)) continue;
    if (group.movement != movement && group.model != kBaseline) continue;
    gathered[{distance.region, group.model}][distance.id] = &distance;
  }
  return gathered;
}

double MeanOver(const ByCase& cases, double DistanceStatistics::*field) {
  double sum = 0;
  for (const auto& [id, distance] : cases) sum += distance->skin.*field;
  return sum / static_cast<double>(cases.size());
}

Json SummaryJson(const ByCase& cases) {
  std::vector<double> distances;
  distances.reserve(cases.size());
  for (const auto& [id, distance] : cases) distances.push_back(distance->skin.mean_absolute_mm);
  const CohortSummary found = SummarizeCohort(distances);
  Json json = {
      {"n", found.n},
      {"mean_mm", Rounded(found.mean_mm)},
      {"sd_mm", Rounded(found.sd_mm)},
      {"mean_low_mm", nullptr},
      {"mean_high_mm", nullptr},
      {"median_mm", Rounded(found.median_mm)},
      {"p90_mm", Rounded(found.p90_mm)},
      {"within_1mm", Rounded(found.within_1mm)},
      {"within_2mm", Rounded(found.within_2mm)},
      {"area_within_1mm", Rounded(1 - MeanOver(cases, &DistanceStatistics::share_over_1mm))},
      {"area_within_2mm", Rounded(1 - MeanOver(cases, &DistanceStatistics::share_over_2mm))},
      {"bias_mm", Rounded(MeanOver(cases, &DistanceStatistics::mean_mm))}};
  if (found.interval) {
    json["mean_low_mm"] = Rounded(found.interval->low);
    json["mean_high_mm"] = Rounded(found.interval->high);
  }
  return json;
}

// Distances are known to 0.001 mm, so that their differences are, too: without rounding, equal
// differences would not be ties.
std::vector<double> PairedDifferences(const ByCase& ours, const ByCase& theirs) {
  std::vector<double> differences;
  for (const auto& [id, distance] : ours) {
    const auto other = theirs.find(id);
    if (other == theirs.end()) continue;
    differences.push_back(
        Rounded(distance->skin.mean_absolute_mm - other->second->skin.mean_absolute_mm));
  }
  return differences;
}

struct CohortTables {
  Json distances = Json::array();
  Json pairs = Json::array();
};

void AddPairs(const Json& where, const std::string& region, const std::vector<std::string>& models,
              const ByPrediction& gathered, CohortTables* tables) {
  for (size_t m = 0; m < models.size(); ++m) {
    for (size_t other = m + 1; other < models.size(); ++other) {
      const auto ours = gathered.find({region, models[m]});
      const auto theirs = gathered.find({region, models[other]});
      if (ours == gathered.end() || theirs == gathered.end()) continue;
      const std::vector<double> differences = PairedDifferences(ours->second, theirs->second);
      if (differences.empty()) continue;
      Json row = where;
      row.update({{"region", region}, {"model", models[m]}, {"other", models[other]}});
      row.update(PairJson(differences));
      tables->pairs.push_back(row);
    }
  }
}

CohortTables TablesOf(const CohortResults& results) {
  const auto models =
      NamesIn(results.distances, [](const CohortDistance& d) { return d.group.model; });
  const auto regions = NamesIn(results.distances, [](const CohortDistance& d) { return d.region; });
  CohortTables tables;
  for (const std::string& operation : OperationsOf(results)) {
    for (const char* movement : {"real", "planned"}) {
      const ByPrediction gathered = Gather(results, operation, movement);
      const Json where = {{"operation", operation}, {"movement", movement}};
      for (const std::string& region : regions) {
        for (const std::string& model : models) {
          const auto found = gathered.find({region, model});
          if (found == gathered.end()) continue;
          Json row = where;
          row.update({{"region", region}, {"model", model}});
          row.update(SummaryJson(found->second));
          tables.distances.push_back(row);
        }
        AddPairs(where, region, models, gathered, &tables);
      }
    }
  }
  return tables;
}

// Groups rows by keys in the order of first appearance, for every operation.
template <typename Row>
Json GroupedJson(const CohortResults& results, const std::vector<Row>& rows,
                 const std::function<std::string(const Row&)>& operation_of,
                 const std::function<Json(const Row&)>& key_of,
                 const std::function<double(const Row&)>& value_of,
                 const std::function<Json(const std::vector<double>&)>& json_of) {
  Json list = Json::array();
  for (const std::string& operation : OperationsOf(results)) {
    std::vector<std::pair<Json, std::vector<double>>> groups;
    std::map<std::string, size_t> places;
    for (const Row& row : rows) {
      if (!IsOf(operation_of(row), operation)) continue;
      const Json key = key_of(row);
      const auto [place, is_new] = places.emplace(key.dump(), groups.size());
      if (is_new) groups.push_back({key, {}});
      groups[place->second].second.push_back(value_of(row));
    }
    for (const auto& [key, values] : groups) {
      Json json = {{"operation", operation}};
      json.update(key);
      json.update(json_of(values));
      list.push_back(json);
    }
  }
  return list;
}

Json AgreementJson(const std::vector<double>& differences) {
  if (differences.size() < 2) return {{"n", differences.size()}};
  const Agreement found = AgreementOf(differences);
  return {{"n", found.n},
          {"bias_mm", Rounded(found.bias)},
          {"sd_mm", Rounded(found.sd)},
          {"low_mm", Rounded(found.low)},
          {"high_mm", Rounded(found.high)}};
}

Json LandmarksJson(const CohortResults& results) {
  return GroupedJson<CohortLandmark>(
      results, results.landmarks, [](const CohortLandmark& row) { return row.group.operation; },
      [](const CohortLandmark& row) {
        return Json{{"movement", row.group.movement},
                    {"model", row.group.model},
                    {"landmark", row.landmark},
                    {"direction", row.direction}};
      },
      [](const CohortLandmark& row) { return row.predicted_mm - row.real_mm; }, AgreementJson);
}

Json DeviationJson(const std::vector<double>& values) {
  const CohortSummary found = SummarizeCohort(values);
  double absolute = 0;
  for (const double value : values) absolute += std::abs(value);
  return {{"n", found.n},
          {"mean", Rounded(found.mean_mm)},
          {"sd", Rounded(found.sd_mm)},
          {"mean_absolute", Rounded(absolute / static_cast<double>(found.n))}};
}

Json DeviationsJson(const CohortResults& results) {
  return GroupedJson<CohortDeviation>(
      results, results.deviations, [](const CohortDeviation& row) { return row.operation; },
      [](const CohortDeviation& row) {
        return Json{{"segment", row.segment}, {"deviation", row.number}};
      },
      [](const CohortDeviation& row) { return row.value; }, DeviationJson);
}

Json CountsJson(const CohortResults& results) {
  std::map<std::string, int> counts;
  for (const CohortCase& row : results.compared) ++counts[row.operation];
  return {{"listed", results.compared.size() + results.refused.size()},
          {"compared", results.compared.size()},
          {"failed", results.refused.size()},
          {"compared_by_operation", counts}};
}

Json RefusedJson(const CohortResults& results) {
  Json list = Json::array();
  for (const CohortRefusal& refusal : results.refused) {
    list.push_back(
        {{"case", refusal.id}, {"operation", refusal.operation}, {"reason", refusal.reason}});
  }
  return list;
}

}  // namespace

std::vector<std::string> OperationsOf(const CohortResults& results) {
  std::map<std::string, int> counts;
  for (const CohortCase& row : results.compared) ++counts[row.operation];
  std::vector<std::string> names = {kTogether};
  if (counts.size() < 2) return names;
  for (const auto& [name, count] : counts) names.push_back(name);
  return names;
}

bool IsOf(const std::string& operation, const std::string& group) {
  return group == kTogether || group == operation;
}

Json PairJson(const std::vector<double>& differences) {
  const SignedRankTest test = TestSignedRanks(differences);
  const CohortSummary found = SummarizeCohort(differences);
  return {{"pairs", differences.size()},
          {"mean_difference_mm", Rounded(found.mean_mm)},
          {"median_difference_mm", Rounded(found.median_mm)},
          {"n", test.n},
          {"rank_sum", test.rank_sum},
          {"p", test.p},
          {"exact", test.exact}};
}

Json CohortJson(const CohortResults& results) {
  const CohortTables tables = TablesOf(results);
  return {{"format", "tissueform-cohort"},
          {"version", 1},
          {"notice", "research software, not a medical device"},
          {"software", absl::StrCat("tissueform ", SoftwareVersion())},
          {"cases", CountsJson(results)},
          {"failed", RefusedJson(results)},
          {"distances", tables.distances},
          {"paired_tests", tables.pairs},
          {"landmarks", LandmarksJson(results)},
          {"segment_deviations", DeviationsJson(results)},
          {"calibration", CalibrationJson(results)}};
}

}  // namespace tissueform
