// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/fit_targets.h"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/json_values.h"
#include "core/planning/selector.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;

const JsonSchema& Schema() {
  static const JsonSchema* const schema = new JsonSchema(FitTargetsSchemaText());
  return *schema;
}

// What follows reads a text that has passed the schema: keys and types are as they must be.

// In LPS; of the patient.
Vector3d NamedDirection(const std::string& name) {
  if (name == "forward") return {0, -1, 0};
  if (name == "backward") return {0, 1, 0};
  if (name == "up") return {0, 0, 1};
  if (name == "down") return {0, 0, -1};
  return {name == "left" ? 1.0 : -1.0, 0, 0};
}

Vector3d ToDirection(const Json& json, CoordinateSystem axes) {
  if (json.is_array()) return VectorFromJson(json);
  return SignsToLps(axes).cwiseProduct(NamedDirection(json.get<std::string>()));
}

std::optional<Vector3d> OptionalVector(const Json& json, const char* key) {
  if (!json.contains(key)) return std::nullopt;
  return VectorFromJson(json.at(key));
}

absl::StatusOr<std::vector<int32_t>> VerticesOfPlace(const Json& at, const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const std::vector<SkinPlace> places, SkinPlaces(problem.point_data));
  const std::string name = at.at("place");
  const SkinPlace* place = FindPlace(places, name);
  if (place == nullptr) {
    if (places.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the mesh has no named places (no point array skin_region), so it has no place \"", name,
          "\"; give point_mm"));
    }
    return absl::InvalidArgumentError(absl::StrCat(
        "the mesh has no place \"", name, "\"; it has ",
        absl::StrJoin(places, ", ",
                      [](std::string* out, const SkinPlace& known) { out->append(known.name); })));
  }
  if (!at.value("foremost", false)) return place->vertices;
  return std::vector<int32_t>{ForemostVertex(problem.mesh->positions(), place->vertices)};
}

// Of a selector those that are skin.
absl::StatusOr<std::vector<int32_t>> SelectedSkin(const Json& at, const PlanProblem& problem) {
  Positions positions = problem.mesh->positions();
  SwapToOrFromLps(problem.written_in, &positions);
  TF_ASSIGN_OR_RETURN(
      std::vector<int32_t> vertices,
      ResolveSelector(SelectorFromJson(at), {positions, problem.point_data}, "\"at\""));
  const std::vector<int32_t> surface = BoundaryVertices(*problem.mesh);
  std::erase_if(vertices, [&surface](int32_t vertex) {
    return !std::binary_search(surface.begin(), surface.end(), vertex);
  });
  if (!vertices.empty()) return vertices;
  return absl::InvalidArgumentError("\"at\" selects no vertex of the surface");
}

absl::Status ReadPoint(const Json& at, const PlanProblem& problem, FitTargetRequest* target) {
  target->point_mm = OptionalVector(at, "point_mm");
  if (target->point_mm) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(target->vertices, at.contains("place") ? VerticesOfPlace(at, problem)
                                                             : SelectedSkin(at, problem));
  return absl::OkStatus();
}

absl::StatusOr<FitTargetRequest> ToTarget(const Json& json, const PlanProblem& problem) {
  if (json.contains("along") != json.contains("by_mm")) {
    return absl::InvalidArgumentError("along and by_mm belong together; give both");
  }
  FitTargetRequest target;
  TF_RETURN_IF_ERROR(ReadPoint(json.at("at"), problem, &target));
  target.position_mm = OptionalVector(json, "to_mm");
  target.displacement_mm = OptionalVector(json, "move_mm");
  if (json.contains("along")) {
    target.direction = ToDirection(json.at("along"), problem.written_in);
    target.movement_mm = json.at("by_mm");
  }
  target.weight = json.value("weight", 1.0);
  return target;
}

// Names are left out where there is one of a place.
std::string NameOf(const Json& target, size_t index) {
  const std::string number = absl::StrCat("target ", index + 1);
  return target.value("name", target.at("at").value("place", number));
}

std::array<FitFreedom::Range, 3> ToRanges(const Json& json, const char* key, double unit) {
  std::array<FitFreedom::Range, 3> ranges;
  if (!json.contains(key)) return ranges;
  for (size_t axis = 0; axis < ranges.size(); ++axis) {
    const Json& bounds = json.at(key).at(axis);
    if (bounds.is_null()) continue;
    ranges[axis] = {bounds.at(0).get<double>() * unit, bounds.at(1).get<double>() * unit};
  }
  return ranges;
}

FitFreedom ToFreedom(const Json& json) {
  constexpr double kDegree = std::numbers::pi / 180;
  return {.handle = json.at("handle"),
          .rotation = ToRanges(json, "rotation_vector_deg", kDegree),
          .translation = ToRanges(json, "translation_mm", 1),
          .pivot_mm = OptionalVector(json, "pivot_mm")};
}

absl::StatusOr<FitRequest> ToRequest(const Json& json, const PlanProblem& problem) {
  const std::string of_plan = problem.written_in == CoordinateSystem::kRas ? "RAS" : "LPS";
  if (json.at("coordinate_system") != of_plan) {
    return absl::InvalidArgumentError(
        absl::StrCat("its coordinate_system is ", json.at("coordinate_system").get<std::string>(),
                     " but the plan's is ", of_plan, "; write the targets in the plan's"));
  }
  FitRequest request;
  request.axes = problem.written_in;
  for (const Json& target : json.at("targets")) {
    const std::string name = NameOf(target, request.targets.size());
    absl::StatusOr<FitTargetRequest> made = ToTarget(target, problem);
    if (!made.ok()) {
      return absl::Status(made.status().code(),
                          absl::StrCat("target \"", name, "\": ", made.status().message()));
    }
    made->name = name;
    request.targets.push_back(*std::move(made));
  }
  for (const Json& free : json.at("free")) request.moving.push_back(ToFreedom(free));
  request.symmetric = json.value("symmetric", false);
  request.less_movement = json.value("less_movement", request.less_movement);
  request.tolerance_mm = json.value("tolerance_mm", request.tolerance_mm);
  TF_RETURN_IF_ERROR(CheckFitRequest(request));
  return request;
}

absl::StatusOr<FitRequest> ParseUnnamed(const std::string& text, const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  TF_RETURN_IF_ERROR(Schema().Check(json));
  try {
    return ToRequest(json, problem);
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(absl::StrCat("cannot be read: ", exception.what()));
  }
}

}  // namespace

absl::StatusOr<FitRequest> ParseFitTargets(std::string_view json, const std::string& name,
                                           const PlanProblem& problem) {
  absl::StatusOr<FitRequest> request = ParseUnnamed(std::string(json), problem);
  if (request.ok()) return request;
  return absl::Status(request.status().code(),
                      absl::StrCat("targets ", name, ": ", request.status().message()));
}

absl::StatusOr<FitRequest> ReadFitTargets(const std::string& path, const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(path, "targets", kMaxTargetsBytes));
  return ParseFitTargets(text, path, problem);
}

}  // namespace tissueform
