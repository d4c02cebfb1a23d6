// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/total_band.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"

#include "core/base/json/json_file.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/skin_region.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

// Less than this has no direction of its own: the skin's normal is used.
constexpr double kMovedMm = 0.1;
constexpr int64_t kLargestDeviationsBytes = 64 << 10;
constexpr double kLargestDeviation = 100;  // mm or degrees

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

absl::StatusOr<Deviations> ParseDeviations(const std::string& text) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  if (!json.is_object()) return absl::InvalidArgumentError("is not a JSON object");
  Deviations deviations;
  deviations.source = "given";
  for (const auto& [key, value] : json.items()) {
    if (key == "surgery" && value.is_object()) {
      TF_RETURN_IF_ERROR(ReadSurgery(value, &deviations.surgery));
    } else if (key == "model_mm" && value.is_object()) {
      TF_RETURN_IF_ERROR(ReadModel(value, &deviations));
    } else if (key == "source" && value.is_string()) {
      deviations.source = value.get<std::string>();
    } else {
      return absl::InvalidArgumentError(
          absl::StrCat("key \"", key,
                       "\" is not known or of another type; allowed: \"surgery\" {}, "
                       "\"model_mm\" {}, \"source\" \"\""));
    }
  }
  return deviations;
}

double ModelDeviation(const Deviations& deviations, const std::string& place) {
  const auto found = deviations.model_of_place_mm.find(place);
  return found == deviations.model_of_place_mm.end() ? deviations.model_mm : found->second;
}

// One variable a place: its skin is off along its normal as a whole.
AnswerExpansion ExpandModel(const std::vector<SkinPlace>& places, const Positions& normals,
                            const Deviations& deviations) {
  AnswerExpansion expansion;
  for (const SkinPlace& place : places) {
    if (place.name == "face") continue;
    Eigen::VectorXd field = Eigen::VectorXd::Zero(normals.size());
    for (const int32_t v : place.vertices) {
      field.segment<3>(3 * v) = ModelDeviation(deviations, place.name) * normals.row(v).transpose();
    }
    expansion.terms.push_back({.first = expansion.variables++, .field = field});
  }
  return expansion;
}

double HalfWidth(const AnswerExpansion& part, int32_t vertex, const Eigen::Vector3d& direction) {
  const BandInterval interval = SampleAlong(part, vertex, direction);
  return (interval.high_mm - interval.low_mm) / 2;
}

// Without the sign of a zero.
double Tenths(double mm) { return std::round(10 * mm) / 10 + 0.0; }

}  // namespace

absl::StatusOr<Deviations> ReadDeviations(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string text,
                      ReadJsonText(path, "deviations", kLargestDeviationsBytes));
  absl::StatusOr<Deviations> deviations = ParseDeviations(text);
  if (deviations.ok()) return deviations;
  return absl::InvalidArgumentError(
      absl::StrCat("deviations ", path, ": ", deviations.status().message()));
}

absl::StatusOr<std::optional<TotalBand>> FindTotalBand(const PlanProblem& problem,
                                                       const Positions& deformed,
                                                       MeshPreparation* preparation,
                                                       const AnswerExpansion* material,
                                                       const Deviations& deviations) {
  TF_ASSIGN_OR_RETURN(const std::vector<SkinPlace> places, SkinPlaces(problem.point_data));
  if (places.empty()) return std::nullopt;
  TF_ASSIGN_OR_RETURN(const AnswerExpansion surgery,
                      ExpandSurgery(preparation, problem.poses, deformed,
                                    Eigen::Matrix3d::Identity(), deviations.surgery));
  const Positions normals = SurfaceNormals(*problem.mesh, deformed);
  const AnswerExpansion model = ExpandModel(places, normals, deviations);
  AnswerExpansion all = surgery;
  Append(model, &all);
  if (material != nullptr) Append(*material, &all);
  const int threads = problem.deformer.preparation.threads;
  TotalBand band{.deviations = deviations,
                 .places = {},
                 .total_mm = SampleBand(all, normals, threads).size_mm,
                 .surgery_mm = SampleBand(surgery, normals, threads).size_mm};
  const Positions& rest = problem.mesh->positions();
  for (const SkinPlace& place : places) {
    if (place.name == "face") continue;
    const int32_t vertex = ForemostVertex(rest, place.vertices);
    const Eigen::Vector3d moved = deformed.row(vertex) - rest.row(vertex);
    const bool has_direction = moved.norm() > kMovedMm;
    const Eigen::Vector3d direction =
        has_direction ? moved.normalized() : Eigen::Vector3d(normals.row(vertex));
    const double along = direction.dot(moved);
    const BandInterval added = SampleAlong(all, vertex, direction);
    band.places.push_back({.name = place.name,
                           .movement_mm = along,
                           .interval = {along + added.low_mm, along + added.high_mm},
                           .surgery_mm = HalfWidth(surgery, vertex, direction),
                           .model_mm = HalfWidth(model, vertex, direction),
                           .material_mm = {}});
    if (material != nullptr) {
      band.places.back().material_mm = HalfWidth(*material, vertex, direction);
    }
  }
  return band;
}

nlohmann::ordered_json TotalBandToJson(const TotalBand& band) {
  const auto list = [](const Eigen::Vector3d& v) {
    return nlohmann::ordered_json{v[0], v[1], v[2]};
  };
  const Deviations& used = band.deviations;
  nlohmann::ordered_json model = {{"default", used.model_mm}};
  for (const auto& [place, mm] : used.model_of_place_mm) model[place] = mm;
  nlohmann::ordered_json json = {{"deviations",
                                  {{"source", used.source},
                                   {"surgery",
                                    {{"translation_mm", list(used.surgery.translation_mm)},
                                     {"rotation_deg", list(used.surgery.rotation_deg)}}},
                                   {"model_mm", model}}},
                                 {"places", nlohmann::ordered_json::array()}};
  for (const TotalBand::Place& place : band.places) {
    nlohmann::ordered_json of_place = {{"name", place.name},
                                       {"movement_mm", place.movement_mm},
                                       {"low_mm", place.interval.low_mm},
                                       {"high_mm", place.interval.high_mm},
                                       {"surgery_mm", place.surgery_mm},
                                       {"model_mm", place.model_mm}};
    if (place.material_mm) of_place["material_mm"] = *place.material_mm;
    json["places"].push_back(of_place);
  }
  return json;
}

std::string TotalBandText(const TotalBand& band) {
  std::string text = absl::StrFormat(
      "movement of foremost points, 95 %% interval by deviations of surgery and model (%s):\n",
      band.deviations.source);
  for (const TotalBand::Place& place : band.places) {
    absl::StrAppendFormat(&text,
                          "  %-11s %.1f mm, 95 %%: %.1f to %.1f; of this surgery %.1f, model %.1f",
                          place.name, Tenths(place.movement_mm), Tenths(place.interval.low_mm),
                          Tenths(place.interval.high_mm), place.surgery_mm, place.model_mm);
    if (place.material_mm) absl::StrAppendFormat(&text, ", material %.2f", *place.material_mm);
    absl::StrAppend(&text, "\n");
  }
  return text;
}

void AddTotalBand(const TotalBand& band, TetMeshFile* file) {
  const auto add = [file](const char* name, const Eigen::VectorXd& values) {
    file->point_data.push_back({name, 1, std::vector<double>(values.begin(), values.end())});
  };
  add(kTotalUncertaintyArray, band.total_mm);
  add(kSurgeryUncertaintyArray, band.surgery_mm);
}

}  // namespace tissueform
