// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_fit_report.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/predict/fit_values.h"
#include "client/cli/shared/stats_json.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Directions that are printed; JSON has all.
constexpr size_t kMaxPrinted = 6;
// A direction of which the targets decide less than half is decided by moving least.
constexpr double kDecided = 0.5;

// Without the sign of what is printed as zero.
double Printed(double value) { return std::abs(value) < 0.0005 ? 0.0 : value; }

std::string VectorText(const Vector3d& vector) {
  return absl::StrFormat("[%.2f, %.2f, %.2f]", Printed(vector.x()), Printed(vector.y()),
                         Printed(vector.z()));
}

std::string TargetsText(const FitReport& report) {
  std::string text =
      absl::StrFormat("  %-24s %10s %10s %10s\n", "target", "target mm", "reached mm", "missed mm");
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
      absl::StrAppendFormat(
          &text, "%10.0f %% %14s\n", 100 * by_targets,
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
    absl::StrAppendFormat(&text,
                          "  %s: its center moves %s mm (%.2f mm), it rotates by %.2f degrees\n",
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
  const bool too_few =
      report.problem->num_equations() < static_cast<Eigen::Index>(report.problem->unknowns.size());
  std::string text = absl::StrFormat(
      "%d free numbers, %d target equations%s: %d combinations are not determined and "
      "move least.\nSuch a combination, for 1 mm of bone movement:\n",
      report.problem->unknowns.size(), report.problem->num_equations(),
      too_few ? ", more free numbers than equations" : "", undecided.size());
  for (size_t k = 0; k < std::min(kMaxPrinted, undecided.size()); ++k) {
    absl::StrAppend(&text, "  ", DirectionName(report, *undecided[k]), "\n");
  }
  if (undecided.size() > kMaxPrinted) {
    absl::StrAppend(&text, "  and ", undecided.size() - kMaxPrinted, " more (--json)\n");
  }
  return text;
}

std::string ContradictionsText(const FitReport& report) {
  std::string text;
  for (const auto& [a, b] : report.fit->contradictions) {
    absl::StrAppendFormat(&text,
                          "\"%s\" and \"%s\" need the same bone movement but have different goals: "
                          "missed by %.2f and %.2f mm\n",
                          report.problem->targets[a].name, report.problem->targets[b].name,
                          report.fit->targets[a].missed_mm, report.fit->targets[b].missed_mm);
  }
  return text;
}

}  // namespace

std::string FitReportText(const FitReport& report) {
  const PlanFit& fit = *report.fit;
  std::string text =
      absl::StrCat("fit of ", report.plan_path, " to ", report.targets_path, ", ", report.model,
                   "; axes ", report.problem->axes == CoordinateSystem::kRas ? "RAS" : "LPS",
                   report.problem->symmetric ? ", symmetric" : "", "\n");
  absl::StrAppend(&text, TargetsText(report), "\n", ParametersText(report), "\n", BoneText(report));
  absl::StrAppendFormat(
      &text, "bone moves %.2f mm (rms of the moving handles, from rest), %.3f s for the fit\n",
      fit.movement_mm, report.fit_seconds);
  absl::StrAppendFormat(
      &text,
      "reached by the full model (%d answers); prepared answers differ from it by "
      "at most %.4f mm\n",
      fit.model_answers, fit.prepared_error_mm);
  if (fit.seal) absl::StrAppend(&text, SealText(*fit.seal), "\n");
  absl::StrAppend(&text, ContradictionsText(report), UndeterminedText(report));
  absl::StrAppend(
      &text,
      "by targets: the share of a number that they determine, the rest moves least; error "
      "per mm: the change\nof the number if all targets change by 1 mm. Neither "
      "includes the error of the model or of surgery.\n");
  if (!report.out_path.empty()) absl::StrAppend(&text, "wrote ", report.out_path, "\n");
  absl::StrAppend(&text, kNotMedicalDeviceNotice, "\n");
  return text;
}

absl::Status CheckReached(const FitReport& report) {
  size_t worst = 0;
  size_t missed = 0;
  for (size_t t = 0; t < report.fit->targets.size(); ++t) {
    missed += IsReached(report, t) ? 0 : 1;
    if (report.fit->targets[t].missed_mm > report.fit->targets[worst].missed_mm) worst = t;
  }
  if (missed == 0) return absl::OkStatus();
  const auto miss_of = [&report](size_t t) {
    return absl::StrFormat("\"%s\" by %.2f mm", report.problem->targets[t].name,
                           report.fit->targets[t].missed_mm);
  };
  std::string message =
      absl::StrCat(missed, " of ", report.fit->targets.size(), " targets cannot be reached: ");
  if (!report.fit->contradictions.empty()) {
    const auto [a, b] = report.fit->contradictions.front();
    absl::StrAppend(&message, "missed: ", miss_of(a), " and ", miss_of(b),
                    ", which contradict each other");
  } else {
    absl::StrAppend(&message, "largest miss: ", miss_of(worst));
  }
  std::vector<std::string> held;
  for (size_t i = 0; i < report.fit->unknowns.size(); ++i) {
    if (report.fit->unknowns[i].bound == ActiveBound::kNone) continue;
    held.push_back(UnknownName(*report.problem, report.problem->unknowns[i]));
  }
  if (!held.empty()) absl::StrAppend(&message, "; active bounds: ", absl::StrJoin(held, ", "));
  return absl::FailedPreconditionError(
      absl::StrCat(message, "; with --accept-misses the exit code is 0"));
}

}  // namespace tissueform
