// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_fit_json.h"

#include <utility>
#include <vector>

#include "client/cli/predict/fit_values.h"
#include "client/cli/shared/stats_json.h"
#include "client/cli/shared/version.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson VectorJson(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  return std::vector<double>(vector.data(), vector.data() + vector.size());
}

OrderedJson TargetsJson(const FitReport& report) {
  OrderedJson json = OrderedJson::array();
  for (size_t t = 0; t < report.problem->targets.size(); ++t) {
    const FitTarget& target = report.problem->targets[t];
    const FittedTarget& fitted = report.fit->targets[t];
    OrderedJson along = OrderedJson::array();
    for (Eigen::Index row = 0; row < target.along.rows(); ++row) {
      along.push_back(VectorJson(InOwnAxes(report, target.along.row(row).transpose())));
    }
    json.push_back({{"name", target.name},
                    {"weight", target.weight},
                    {"off_skin_mm", target.off_skin_mm},
                    {"rest_mm", VectorJson(InOwnAxes(report, target.rest_mm))},
                    {"position_mm", VectorJson(InOwnAxes(report, fitted.position_mm))},
                    {"along", std::move(along)},
                    {"wanted_mm", VectorJson(target.wanted_mm)},
                    {"reached_mm", VectorJson(fitted.reached_mm)},
                    {"missed_mm", fitted.missed_mm},
                    {"reached", IsReached(report, t)}});
  }
  return json;
}

OrderedJson ParametersJson(const FitReport& report) {
  OrderedJson json = OrderedJson::array();
  for (size_t i = 0; i < report.problem->unknowns.size(); ++i) {
    const FitUnknown& unknown = report.problem->unknowns[i];
    const FittedUnknown& fitted = report.fit->unknowns[i];
    const double units = UnitsOf(unknown);
    json.push_back({{"parameter", UnknownName(*report.problem, unknown)},
                    {"handle", report.problem->handle_names[unknown.handle]},
                    {"unit", unknown.is_rotation ? "deg" : "mm"},
                    {"value", fitted.value * units},
                    {"lower", unknown.lower * units},
                    {"upper", unknown.upper * units},
                    {"held_by_bound", BoundName(fitted.bound)},
                    {"decided_by_targets", fitted.determination.by_targets},
                    {"error_per_mm_of_target", fitted.determination.error_per_mm * units}});
  }
  return json;
}

OrderedJson DirectionsJson(const FitReport& report) {
  OrderedJson json = OrderedJson::array();
  for (const FitDirection& direction : report.fit->directions) {
    OrderedJson shares = OrderedJson::object();
    for (size_t i = 0; i < report.problem->unknowns.size(); ++i) {
      const FitUnknown& unknown = report.problem->unknowns[i];
      shares[UnknownName(*report.problem, unknown)] =
          direction.shares[static_cast<Eigen::Index>(i)] * UnitsOf(unknown);
    }
    json.push_back({{"target_mm_per_mm_of_bone", direction.singular_value},
                    {"decided_by_targets", direction.by_targets},
                    {"per_mm_of_bone", std::move(shares)}});
  }
  return json;
}

OrderedJson HandlesJson(const FitReport& report) {
  OrderedJson json = OrderedJson::array();
  for (size_t h = 0; h < report.fit->poses.size(); ++h) {
    const HandlePose pose = SwapToOrFromLps(report.problem->axes, report.fit->poses[h]);
    json.push_back({{"name", report.problem->handle_names[h]},
                    {"moves", IsMoving(report, h)},
                    {"pose", ToJson(pose)},
                    {"middle_moves_mm", VectorJson(MiddleMoves(report, h))},
                    {"turns_deg", pose.rotation_vector.norm() * kDegreesPerRadian}});
  }
  return json;
}

}  // namespace

OrderedJson FitReportJson(const FitReport& report) {
  const PlanFit& fit = *report.fit;
  OrderedJson contradictions = OrderedJson::array();
  for (const auto& [a, b] : fit.contradictions) {
    contradictions.push_back({report.problem->targets[a].name, report.problem->targets[b].name});
  }
  OrderedJson json = {
      {"format", "tissueform-fit"},
      {"version", kVersion},
      {"plan", report.plan_path},
      {"targets_file", report.targets_path},
      {"model", report.model},
      {"coordinate_system", report.problem->axes == CoordinateSystem::kRas ? "RAS" : "LPS"},
      {"symmetric", report.problem->symmetric},
      {"less_movement", report.problem->less_movement},
      {"tolerance_mm", report.problem->tolerance_mm},
      {"reached", CheckReached(report).ok()},
      {"targets", TargetsJson(report)},
      {"parameters", ParametersJson(report)},
      {"handles", HandlesJson(report)},
      {"contradictions", std::move(contradictions)},
      {"equations", report.problem->num_equations()},
      {"directions", DirectionsJson(report)},
      {"movement_rms_mm", fit.movement_mm},
      {"converged", fit.converged},
      {"iterations", fit.iterations},
      {"verified", fit.verified},
      {"model_converged", fit.model_converged},
      {"model_answers", fit.model_answers},
      {"prepared_error_mm", fit.prepared_error_mm}};
  if (fit.seal) json["seal"] = SealToJson(*fit.seal);
  json["seconds"] = {{"prepare", report.prepare_seconds},
                     {"search", fit.search_seconds},
                     {"fit", report.fit_seconds}};
  json["notice"] = kNotMedicalDeviceNotice;
  return json;
}

}  // namespace tissueform
