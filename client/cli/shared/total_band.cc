// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/total_band.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

// Less than this has no direction of its own: the skin's normal is used.
constexpr double kMovedMm = 0.1;

// One variable a place: its skin is off along its normal as a whole.
AnswerExpansion ExpandModel(const std::vector<SkinPlace>& places, const Positions& normals,
                            const Deviations& deviations) {
  AnswerExpansion expansion;
  for (const SkinPlace& place : places) {
    if (place.name == "face") continue;
    Eigen::VectorXd field = Eigen::VectorXd::Zero(normals.size());
    for (const int32_t v : place.vertices) {
      field.segment<3>(3 * v) = deviations.ModelOf(place.name) * normals.row(v).transpose();
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
  nlohmann::ordered_json json = {{"deviations", DeviationsToJson(band.deviations)},
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
