// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/deviations.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include <Eigen/Core>

#include "core/base/json/json_file.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/skin_region.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr int64_t kLargestDeviationsBytes = 64 << 10;
constexpr double kLargestDeviation = 100;  // mm or degrees
// Liebregts 2015: a mean absolute distance of 0.9 mm of the lower face, as of normal values.
constexpr double kLowerJawForwardMm = 1.13;

absl::Status WrongValue(const std::string& key) {
  return absl::InvalidArgumentError(absl::StrFormat(
      "\"%s\" needs numbers from 0 to %g (standard deviations)", key, kLargestDeviation));
}

absl::StatusOr<double> ReadNumber(const std::string& key, const Json& value) {
  if (!value.is_number()) return WrongValue(key);
  const double number = value.get<double>();
  if (!(number >= 0 && number <= kLargestDeviation)) return WrongValue(key);
  return number;
}

absl::Status ReadAxes(const std::string& key, const Json& value, Eigen::Vector3d* axes) {
  if (!value.is_array() || value.size() != 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", key, "\" needs three numbers: left-right, forward-back, up-down"));
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    TF_ASSIGN_OR_RETURN((*axes)[axis], ReadNumber(key, value[static_cast<size_t>(axis)]));
  }
  return absl::OkStatus();
}

absl::Status ReadSurgery(const Json& json, SurgeryDeviation* surgery) {
  for (const auto& [key, value] : json.items()) {
    if (key == "translation_mm") {
      TF_RETURN_IF_ERROR(ReadAxes(key, value, &surgery->translation_mm));
    } else if (key == "rotation_deg") {
      TF_RETURN_IF_ERROR(ReadAxes(key, value, &surgery->rotation_deg));
    } else {
      return absl::InvalidArgumentError(absl::StrCat(
          "unknown key \"", key, "\" in \"surgery\"; allowed: translation_mm, rotation_deg"));
    }
  }
  return absl::OkStatus();
}

// A misspelled place would be left out without a word.
absl::Status CheckPlace(const std::string& name) {
  std::vector<absl::string_view> known = {"default"};
  for (const SkinRegion region : kNamedSkinRegions) known.push_back(SkinRegionName(region));
  if (std::ranges::find(known, name) != known.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "unknown place \"", name, "\" in \"model_mm\"; allowed: ", absl::StrJoin(known, ", ")));
}

absl::Status ReadModel(const Json& json, Deviations* deviations) {
  for (const auto& [place, value] : json.items()) {
    TF_RETURN_IF_ERROR(CheckPlace(place));
    TF_ASSIGN_OR_RETURN(const double number, ReadNumber(place, value));
    if (place == "default") {
      deviations->model_mm = number;
    } else {
      deviations->model_of_place_mm[place] = number;
    }
  }
  return absl::OkStatus();
}

// What an entry may hold besides operations; `allowed` lists all keys.
absl::Status ReadEntry(const std::string& key, const Json& value, const char* allowed,
                       Deviations* deviations) {
  if (key == "surgery" && value.is_object()) return ReadSurgery(value, &deviations->surgery);
  if (key == "model_mm" && value.is_object()) return ReadModel(value, deviations);
  if (key == "source" && value.is_string()) {
    deviations->source = value.get<std::string>();
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("key \"", key, "\" is not known or of another type; allowed: ", allowed));
}

absl::StatusOr<Deviations> ReadOperation(const std::string& name, const Json& json,
                                         const Deviations& all) {
  if (!IsOperationName(name) || !json.is_object()) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"operations\" needs entries {} with names of up to ", kLongestOperationName,
                     " letters, digits, - and _"));
  }
  Deviations deviations = all;
  absl::StrAppend(&deviations.source, ", ", name);
  for (const auto& [key, value] : json.items()) {
    TF_RETURN_IF_ERROR(
        ReadEntry(key, value, R"("surgery" {}, "model_mm" {}, "source" "")", &deviations));
  }
  return deviations;
}

absl::StatusOr<DeviationTable> ParseDeviations(const std::string& text) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  if (!json.is_object()) return absl::InvalidArgumentError("is not a JSON object");
  DeviationTable table;
  table.all.source = "given";
  const Json* operations = nullptr;
  for (const auto& [key, value] : json.items()) {
    if (key == "operations" && value.is_object()) {
      operations = &value;
      continue;
    }
    TF_RETURN_IF_ERROR(ReadEntry(
        key, value, R"("surgery" {}, "model_mm" {}, "source" "", "operations" {})", &table.all));
  }
  if (operations == nullptr) return table;
  for (const auto& [name, value] : operations->items()) {
    TF_ASSIGN_OR_RETURN(table.operations[name], ReadOperation(name, value, table.all));
  }
  return table;
}

}  // namespace

double Deviations::ModelOf(const std::string& place) const {
  const auto found = model_of_place_mm.find(place);
  return found == model_of_place_mm.end() ? model_mm : found->second;
}

DeviationTable PublishedDeviations() {
  DeviationTable table;
  Deviations forward;
  forward.model_mm = kLowerJawForwardMm;
  forward.source = "published, bsso_forward";
  table.operations["bsso_forward"] = forward;
  return table;
}

bool IsOperationName(absl::string_view name) {
  return !name.empty() && name.size() <= kLongestOperationName &&
         std::ranges::all_of(name,
                             [](char c) { return absl::ascii_isalnum(c) || c == '-' || c == '_'; });
}

absl::StatusOr<DeviationTable> ReadDeviations(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string text,
                      ReadJsonText(path, "deviations", kLargestDeviationsBytes));
  absl::StatusOr<DeviationTable> table = ParseDeviations(text);
  if (table.ok()) return table;
  return absl::InvalidArgumentError(
      absl::StrCat("deviations ", path, ": ", table.status().message()));
}

absl::StatusOr<Deviations> DeviationsOf(const DeviationTable& table, const std::string& operation) {
  if (operation.empty()) return table.all;
  const auto found = table.operations.find(operation);
  if (found != table.operations.end()) return found->second;
  std::vector<absl::string_view> known;
  for (const auto& [name, deviations] : table.operations) known.push_back(name);
  return absl::InvalidArgumentError(
      absl::StrCat("there are no deviations of the operation \"", operation, "\"; ",
                   known.empty() ? "none has its own: leave the operation out"
                                 : absl::StrCat("known are: ", absl::StrJoin(known, ", "))));
}

nlohmann::ordered_json DeviationsToJson(const Deviations& deviations) {
  const auto list = [](const Eigen::Vector3d& v) {
    return nlohmann::ordered_json{v[0], v[1], v[2]};
  };
  nlohmann::ordered_json model = {{"default", deviations.model_mm}};
  for (const auto& [place, mm] : deviations.model_of_place_mm) model[place] = mm;
  return {{"source", deviations.source},
          {"surgery",
           {{"translation_mm", list(deviations.surgery.translation_mm)},
            {"rotation_deg", list(deviations.surgery.rotation_deg)}}},
          {"model_mm", model}};
}

nlohmann::ordered_json DeviationTableToJson(const DeviationTable& table) {
  nlohmann::ordered_json json = DeviationsToJson(table.all);
  for (const auto& [name, deviations] : table.operations) {
    json["operations"][name] = DeviationsToJson(deviations);
  }
  return json;
}

}  // namespace tissueform
