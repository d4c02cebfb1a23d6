// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include <Eigen/Core>

#include "client/cli/outcome/cohort_tables.h"
#include "client/cli/outcome/outcome_json.h"
#include "core/mesh/skin_region.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

// The region that stands for places without figures of their own.
constexpr char kAllSkin[] = "face";

// Of each of three axes the numbers of outcome.json, in the order of docs/deviations.schema.json.
constexpr const char* kShifts[] = {"left_mm", "forward_mm", "up_mm"};
constexpr const char* kTurns[] = {"pitch_deg", "roll_deg", "yaw_deg"};

// A number of figures that says something: with fewer the published ones hold.
bool AreEnough(size_t count) { return count >= kLeastForDeviations; }

// The deviation of normal values from zero, not from their mean: a bias stays in doubt, too.
double RootMeanSquare(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// Null unless all three axes have enough figures.
Json AxesJson(const std::map<std::string, std::vector<double>>& by_number,
              const char* const (&names)[3]) {
  Json axes = Json::array();
  for (const char* name : names) {
    const auto found = by_number.find(name);
    if (found == by_number.end() || !AreEnough(found->second.size())) return nullptr;
    axes.push_back(Rounded(RootMeanSquare(found->second)));
  }
  return axes;
}

// How surgery missed its plans: all segments together.
Json SurgeryJson(const CohortResults& results, const std::string& operation) {
  std::map<std::string, std::vector<double>> by_number;
  for (const CohortDeviation& row : results.deviations) {
    if (IsOf(row.operation, operation)) by_number[row.number].push_back(row.value);
  }
  Json json = Json::object();
  if (Json axes = AxesJson(by_number, kShifts); !axes.is_null()) json["translation_mm"] = axes;
  if (Json axes = AxesJson(by_number, kTurns); !axes.is_null()) json["rotation_deg"] = axes;
  return json;
}

// How far the skin was from a prediction by the bone's real movement. Of a normal value with mean
// zero the mean absolute value is sqrt(2 / pi) of the standard deviation.
Json ModelJson(const CohortResults& results, const std::string& operation,
               const std::string& model) {
  std::map<std::string, std::vector<double>> by_region;
  for (const CohortDistance& row : results.distances) {
    const bool counts = IsOf(row.group.operation, operation) && row.group.model == model &&
                        row.group.movement == "real";
    if (counts) by_region[row.region].push_back(row.skin.mean_absolute_mm);
  }
  const auto deviation = [&by_region](const std::string& region) -> std::optional<double> {
    const std::vector<double>& distances = by_region[region];
    if (!AreEnough(distances.size())) return std::nullopt;
    const double mean_mm = Eigen::Map<const Eigen::VectorXd>(
                               distances.data(), static_cast<Eigen::Index>(distances.size()))
                               .mean();
    return Rounded(mean_mm / std::sqrt(2 / std::numbers::pi));
  };
  Json json = Json::object();
  if (const auto all = deviation(kAllSkin)) json["default"] = *all;
  for (const SkinRegion region : kNamedSkinRegions) {
    const std::string name(SkinRegionName(region));
    if (const auto of_place = deviation(name)) json[name] = *of_place;
  }
  return json;
}

size_t CasesOf(const CohortResults& results, const std::string& operation) {
  size_t count = 0;
  for (const CohortCase& row : results.compared) {
    if (IsOf(row.operation, operation)) ++count;
  }
  return count;
}

// Empty where there are too few figures of the model.
Json EntryJson(const CohortResults& results, const std::string& operation,
               const std::string& model) {
  const Json of_model = ModelJson(results, operation, model);
  if (of_model.empty()) return Json::object();
  Json json = {{"source", absl::StrCat("cohort of ", CasesOf(results, operation), ", ", operation,
                                       ", ", model)}};
  const Json surgery = SurgeryJson(results, operation);
  if (!surgery.empty()) json["surgery"] = surgery;
  json["model_mm"] = of_model;
  return json;
}

}  // namespace

Json DeviationFileJson(const CohortResults& results, const std::string& model) {
  const std::vector<std::string> operations = OperationsOf(results);
  Json json = EntryJson(results, operations[0], model);
  if (json.empty()) return json;
  for (size_t o = 1; o < operations.size(); ++o) {
    Json entry = EntryJson(results, operations[o], model);
    if (!entry.empty()) json["operations"][operations[o]] = std::move(entry);
  }
  return json;
}

}  // namespace tissueform
