// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/planning/json_values.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_io.h"
#include "core/planning/plan_schema.h"
#include "core/planning/planned_contact.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

// What follows reads a text that has passed the schema: keys and types are as they must be.

// {"LABEL": NUMBER, ...}
absl::StatusOr<std::vector<std::pair<int64_t, double>>> ToLabelled(const Json& json,
                                                                   const char* pointer) {
  std::vector<std::pair<int64_t, double>> labelled;
  for (const auto& [label, number] : json.items()) {
    int64_t value = 0;
    if (!absl::SimpleAtoi(label, &value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("label ", label, " at ", pointer, " exceeds 64 bits"));
    }
    labelled.emplace_back(value, number.get<double>());
  }
  return labelled;
}

absl::StatusOr<StiffnessChoice> ToStiffness(const Json& json) {
  if (json.contains("uniform")) return UniformStiffness{json.at("uniform")};
  if (json.contains("cell_data")) return StiffnessFromCellData{json.at("cell_data")};
  StiffnessByCellData by_label{json.at("by_cell_data"), {}};
  TF_ASSIGN_OR_RETURN(by_label.pa_of_value, ToLabelled(json.at("values"), "/stiffness/values"));
  return by_label;
}

absl::StatusOr<PlannedUncertainty> ToUncertainty(const Json& json) {
  PlannedUncertainty uncertainty;
  const Json factor = json.value("youngs_modulus_factor_95", Json(1.0));
  if (factor.is_number()) {
    uncertainty.youngs_modulus_factor_95 = factor.get<double>();
  } else {
    FactorByCellData by_label{factor.at("by_cell_data"), {}};
    TF_ASSIGN_OR_RETURN(
        by_label.factor_of_value,
        ToLabelled(factor.at("values"), "/uncertainty/youngs_modulus_factor_95/values"));
    uncertainty.youngs_modulus_factor_95 = std::move(by_label);
  }
  if (json.contains("poisson_ratio_95")) {
    uncertainty.poisson_ratio_95 = json.at("poisson_ratio_95").get<std::array<double, 2>>();
  }
  return uncertainty;
}

PlannedHandle ToHandle(const Json& json) {
  return {json.at("name"), SelectorFromJson(json.at("region")),
          PoseFromJson(json.value("pose", Json::object()))};
}

absl::Status ReadModel(const Json& json, Plan* plan) {
  TF_ASSIGN_OR_RETURN(plan->model, ModelFromName(json.value("model", "gradient_field")));
  const Json settings = json.value("gradient_field", Json::object());
  GradientFieldOptions& options = plan->gradient_field;
  TF_ASSIGN_OR_RETURN(options.rotation,
                      RotationModeFromName(settings.value("rotation", "propagated")));
  TF_ASSIGN_OR_RETURN(options.guidance, GuidanceFromName(settings.value("guidance", "cotangent")));
  TF_ASSIGN_OR_RETURN(options.blend, BlendFromName(settings.value("blend", "cosine")));
  options.max_iterations = settings.value("max_iterations", options.max_iterations);
  options.tolerance_mm = settings.value("tolerance_mm", options.tolerance_mm);
  return absl::OkStatus();
}

absl::StatusOr<Plan> ToPlan(const Json& json, const std::string& folder) {
  Plan plan;
  plan.coordinate_system =
      json.at("coordinate_system") == "RAS" ? CoordinateSystem::kRas : CoordinateSystem::kLps;
  plan.mesh_path = (std::filesystem::path(folder) / json.at("mesh").get<std::string>())
                       .lexically_normal()
                       .string();
  plan.mesh_sha256 = json.value("mesh_sha256", "");
  TF_ASSIGN_OR_RETURN(plan.stiffness, ToStiffness(json.at("stiffness")));
  plan.poisson_ratio = json.value("poisson_ratio", 0.45);
  plan.fixed = SelectorFromJson(json.at("fixed"));
  for (const Json& handle : json.at("handles")) plan.handles.push_back(ToHandle(handle));
  TF_RETURN_IF_ERROR(ReadModel(json, &plan));
  if (json.contains("uncertainty")) {
    TF_ASSIGN_OR_RETURN(plan.uncertainty, ToUncertainty(json.at("uncertainty")));
  }
  if (json.contains("contact")) {
    const Json& contact = json.at("contact");
    plan.contact = ContactFromJson(contact);
    if (contact.contains("seal")) plan.lip_edge = LipEdgeFromJson(contact.at("seal"));
  }
  return plan;
}

absl::StatusOr<Plan> ParseUnnamed(const std::string& text, const std::string& folder) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  TF_RETURN_IF_ERROR(CheckAgainstPlanSchema(json));
  try {
    return ToPlan(json, folder);
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(absl::StrCat("cannot be read: ", exception.what()));
  }
}

}  // namespace

absl::StatusOr<Plan> ParsePlan(std::string_view json, const std::string& folder,
                               const std::string& name) {
  absl::StatusOr<Plan> plan = ParseUnnamed(std::string(json), folder);
  if (plan.ok()) return plan;
  return absl::Status(plan.status().code(),
                      absl::StrCat("plan ", name, ": ", plan.status().message()));
}

}  // namespace tissueform
