// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_fit_report.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/shared/version.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using OrderedJson = nlohmann::ordered_json;

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;
// Directions that are printed; JSON has all.
constexpr size_t kMostPrinted = 6;
// A direction of which the targets decide less than half is decided by moving least.
constexpr double kDecided = 0.5;

double UnitsOf(const FitUnknown& unknown) {
  return unknown.is_rotation ? kDegreesPerRadian : 1.0;
}

Vector3d InOwnAxes(const FitReport& report, const Vector3d& lps) {
  return SignsToLps(report.problem->axes).cwiseProduct(lps);
}

// Without the sign of what is printed as zero.
double Printed(double value) { return std::abs(value) < 0.0005 ? 0.0 : value; }

std::string VectorText(const Vector3d& vector) {
  return absl::StrFormat("[%.2f, %.2f, %.2f]", Printed(vector.x()), Printed(vector.y()),
                         Printed(vector.z()));
}

OrderedJson VectorJson(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  return std::vector<double>(vector.data(), vector.data() + vector.size());
}

bool IsReached(const FitReport& report, size_t target) {
  return report.fit->targets[target].missed_mm <= report.problem->tolerance_mm;
}

const char* BoundName(ActiveBound bound) {
  switch (bound) {
    case ActiveBound::kNone:
      break;
    case ActiveBound::kLower:
      return "lower";
    case ActiveBound::kUpper:
      return "upper";
  }
  return "none";
}

bool IsMoving(const FitReport& report, size_t handle) {
  const auto& unknowns = report.problem->unknowns;
  return std::any_of(unknowns.begin(), unknowns.end(),
                     [handle](const FitUnknown& unknown) { return unknown.handle == handle; });
}

Vector3d MiddleMoves(const FitReport& report, size_t handle) {
  const auto& vertices = report.plan->constraints.handles()[handle].vertices;
  const Vector3d middle =
      report.plan->mesh->positions()(vertices, Eigen::all).colwise().mean().transpose();
  return InOwnAxes(report, ApplyPose(report.fit->poses[handle], middle) - middle);
}

std::string TargetsText(const FitReport& report) {
  std::string text = absl::StrFormat("  %-24s %10s %10s %10s\n", "target", "wanted mm",
                                     "reached mm", "missed mm");
  for (size_t t = 0; t < report.problem->targets.size(); ++t) {
    const FitTarget& target = report.problem->targets[t];
    const FittedTarget& fitted = report.fit->targets[t];
    // Of three numbers the length that is wanted, and how far it goes that way.
    const double wanted =
        target.wanted_mm.size() == 1 ? target.wanted_mm[0] : target.wanted_mm.norm();
    const double reached = target.wanted_mm.size() == 1 ? fitted.reached_mm[0]
                           : wanted > 0 ? fitted.reached_mm.dot(target.wanted_mm) / wanted
                                        : fitted.reached_mm.norm();
    absl::StrAppendFormat(&text, "  %-24s %10.2f %10.2f %10.2f  %s\n", target.name, wanted, reached,
                          fitted.missed_mm, IsReached(report, t) ? "" : "NOT REACHED");
  }
  return text;
}

std::string ParametersText(const FitReport& report) {
  std::string text = absl::StrFormat("  %-32s %9s %20s %12s %14s\n", "found", "value", "bounds",
                                     "by targets", "error per mm");
  for (size_t i = 0; i < report.problem->unknowns.size(); ++i) {
    const FitUnknown& unknown = report.problem->unknowns[i];
    const FittedUnknown& fitted = report.fit->unknowns[i];
    const double units = UnitsOf(unknown);
    const std::string bounds =
        absl::StrFormat("%.4g to %.4g", unknown.lower * units, unknown.upper * units);
    absl::StrAppendFormat(&text, "  %-32s %9.3f %20s ", UnknownName(*report.problem, unknown),
                          Printed(fitted.value * units), bounds);
    if (fitted.bound != ActiveBound::kNone) {
      absl::StrAppendFormat(&text, "   held by its %s bound\n", BoundName(fitted.bound));
    } else {
      const double by_targets = fitted.determination.by_targets;
      absl::StrAppendFormat(&text, "%10.0f %% %14s\n", 100 * by_targets,
                            by_targets < kDecided
                                ? "moves least"
                                : absl::StrFormat("%.3f", fitted.determination.error_per_mm * units));
    }
  }
  return text;
}

std::string BoneText(const FitReport& report) {
  std::string text;
  for (size_t h = 0; h < report.fit->poses.size(); ++h) {
    if (!IsMoving(report, h)) continue;
    const Vector3d moves = MiddleMoves(report, h);
    absl::StrAppendFormat(&text, "  %s: its middle moves %s mm (%.2f mm), it turns %.2f degrees\n",
                          report.problem->handle_names[h], VectorText(moves), moves.norm(),
                          report.fit->poses[h].rotation_vector.norm() * kDegreesPerRadian);
  }
  return text;
}

std::string DirectionName(const FitReport& report, const FitDirection& direction) {
  return absl::StrJoin(direction.main_unknowns, ", ", [&](std::string* out, size_t i) {
    const FitUnknown& unknown = report.problem->unknowns[i];
    absl::StrAppendFormat(out, "%s %+.2g", UnknownName(*report.problem, unknown),
                          direction.shares[static_cast<Eigen::Index>(i)] * UnitsOf(unknown));
  });
}

std::string UndeterminedText(const FitReport& report) {
  std::vector<const FitDirection*> undecided;
  for (const FitDirection& direction : report.fit->directions) {
    if (direction.by_targets < kDecided) undecided.push_back(&direction);
  }
  if (undecided.empty()) return "";
  const bool too_few = report.problem->num_equations() <
                       static_cast<Eigen::Index>(report.problem->unknowns.size());
  std::string text = absl::StrFormat(
      "%d numbers may move and the targets want %d%s: %d combinations are not told by them and "
      "move least.\nSuch a combination is, for 1 mm of movement of bone:\n",
      report.problem->unknowns.size(), report.problem->num_equations(),
      too_few ? ", more freedoms than targets" : "", undecided.size());
  for (size_t k = 0; k < std::min(kMostPrinted, undecided.size()); ++k) {
    absl::StrAppend(&text, "  ", DirectionName(report, *undecided[k]), "\n");
  }
  if (undecided.size() > kMostPrinted) {
    absl::StrAppend(&text, "  and ", undecided.size() - kMostPrinted, " more (--json)\n");
  }
  return text;
}

std::string ContradictionsText(const FitReport& report) {
  std::string text;
  for (const auto& [a, b] : report.fit->contradictions) {
    absl::StrAppendFormat(&text,
                          "\"%s\" and \"%s\" ask the same of the bone and want different things: "
                          "missed by %.2f and %.2f mm\n",
                          report.problem->targets[a].name, report.problem->targets[b].name,
                          report.fit->targets[a].missed_mm, report.fit->targets[b].missed_mm);
  }
  return text;
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

std::string FitReportText(const FitReport& report) {
  const PlanFit& fit = *report.fit;
  std::string text = absl::StrCat("fit of ", report.plan_path, " to ", report.targets_path, ", ",
                                  report.model, "; axes ",
                                  report.problem->axes == CoordinateSystem::kRas ? "RAS" : "LPS",
                                  report.problem->symmetric ? ", symmetric" : "", "\n");
  absl::StrAppend(&text, TargetsText(report), "\n", ParametersText(report), "\n", BoneText(report));
  absl::StrAppendFormat(
      &text, "bone moves %.2f mm (rms of the moving handles, from rest), %.3f s for the fit\n",
      fit.movement_mm, report.fit_seconds);
  absl::StrAppendFormat(&text,
                        "reached by the full model (%d answers); prepared answers were off it by "
                        "%.4f mm at most\n",
                        fit.model_answers, fit.prepared_error_mm);
  absl::StrAppend(&text, ContradictionsText(report), UndeterminedText(report));
  absl::StrAppend(&text,
                  "by targets: what part of a number they decide, the rest is moved least; error "
                  "per mm: what it\nwould differ by, were all that is wanted off by 1 mm. Neither "
                  "is the error of the model or of surgery.\n");
  if (!report.out_path.empty()) absl::StrAppend(&text, "wrote ", report.out_path, "\n");
  absl::StrAppend(&text, kNotMedicalDeviceNotice, "\n");
  return text;
}

OrderedJson FitReportJson(const FitReport& report) {
  const PlanFit& fit = *report.fit;
  OrderedJson contradictions = OrderedJson::array();
  for (const auto& [a, b] : fit.contradictions) {
    contradictions.push_back({report.problem->targets[a].name, report.problem->targets[b].name});
  }
  return {{"format", "tissueform-fit"},
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
          {"prepared_error_mm", fit.prepared_error_mm},
          {"seconds",
           {{"prepare", report.prepare_seconds},
            {"search", fit.search_seconds},
            {"fit", report.fit_seconds}}},
          {"notice", kNotMedicalDeviceNotice}};
}

absl::Status CheckReached(const FitReport& report) {
  size_t worst = 0;
  size_t missed = 0;
  for (size_t t = 0; t < report.fit->targets.size(); ++t) {
    missed += IsReached(report, t) ? 0 : 1;
    if (report.fit->targets[t].missed_mm > report.fit->targets[worst].missed_mm) worst = t;
  }
  if (missed == 0) return absl::OkStatus();
  const auto told = [&report](size_t t) {
    return absl::StrFormat("\"%s\" by %.2f mm", report.problem->targets[t].name,
                           report.fit->targets[t].missed_mm);
  };
  std::string message = absl::StrCat(missed, " of ", report.fit->targets.size(),
                                     " targets cannot be reached: ");
  if (!report.fit->contradictions.empty()) {
    const auto [a, b] = report.fit->contradictions.front();
    absl::StrAppend(&message, "missed are ", told(a), " and ", told(b),
                    ", which contradict each other");
  } else {
    absl::StrAppend(&message, "missed most is ", told(worst));
  }
  std::vector<std::string> held;
  for (size_t i = 0; i < report.fit->unknowns.size(); ++i) {
    if (report.fit->unknowns[i].bound == ActiveBound::kNone) continue;
    held.push_back(UnknownName(*report.problem, report.problem->unknowns[i]));
  }
  if (!held.empty()) absl::StrAppend(&message, "; bounds hold ", absl::StrJoin(held, ", "));
  return absl::FailedPreconditionError(
      absl::StrCat(message, "; give --accept-misses to end well all the same"));
}

}  // namespace tissueform
