// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/movement_table.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/mesh/skin_region.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

constexpr std::array<SkinRegion, 4> kProfile = {SkinRegion::kChin, SkinRegion::kLowerLip,
                                                SkinRegion::kUpperLip, SkinRegion::kNose};

struct PlaceMovement {
  int32_t vertex = 0;           // the foremost one
  Eigen::RowVector3d foremost;  // LPS, mm
  Eigen::RowVector3d mean;      // over the place
};

// LPS: x to the patient's left, y to the back, z up.
double ForwardMm(const Eigen::RowVector3d& lps_mm) { return -lps_mm.y(); }
double UpMm(const Eigen::RowVector3d& lps_mm) { return lps_mm.z(); }
double LeftMm(const Eigen::RowVector3d& lps_mm) { return lps_mm.x(); }

PlaceMovement MovementOf(const AccuracyCase& problem, const SkinPlace& place,
                         const ModelAnswer& answer) {
  const Positions& rest = problem.mesh.positions();
  const int32_t vertex = ForemostVertex(rest, place.vertices);
  const Positions moved =
      answer.positions(place.vertices, Eigen::all) - rest(place.vertices, Eigen::all);
  return {vertex, answer.positions.row(vertex) - rest.row(vertex), moved.colwise().mean()};
}

std::vector<SkinPlace> ProfileOf(const AccuracyCase& problem) {
  std::vector<SkinPlace> profile;
  for (const SkinRegion region : kProfile) {
    const SkinPlace* place = FindPlace(problem.places, SkinRegionName(region));
    if (place != nullptr) profile.push_back(*place);
  }
  return profile;
}

void AddAnswers(const AccuracyCase& problem, const std::vector<ModelAnswer>& answers,
                double poisson_ratio, CsvTable* table) {
  for (const ModelAnswer& answer : answers) {
    for (const SkinPlace& place : ProfileOf(problem)) {
      const PlaceMovement m = MovementOf(problem, place, answer);
      table->AddRow({problem.name, Cell(poisson_ratio), answer.name, place.name,
                     absl::StrCat(m.vertex), Cell(ForwardMm(m.foremost)), Cell(UpMm(m.foremost)),
                     Cell(LeftMm(m.foremost)), Cell(m.foremost.norm()), Cell(ForwardMm(m.mean)),
                     Cell(UpMm(m.mean)), Cell(LeftMm(m.mean))});
    }
  }
}

std::string ForwardAndUp(const Eigen::RowVector3d& lps_mm) {
  // What is less than half a hundredth has no sign.
  const auto rounded = [](double value) { return std::round(100 * value) / 100 + 0.0; };
  return absl::StrFormat("%.2f / %.2f", rounded(ForwardMm(lps_mm)), rounded(UpMm(lps_mm)));
}

}  // namespace

CsvTable MovementTable() {
  return CsvTable({"case", "nu", "answer", "place", "vertex", "forward_mm", "up_mm", "left_mm",
                   "moved_mm", "mean_forward_mm", "mean_up_mm", "mean_left_mm"});
}

void AddMovementRows(const AccuracyCase& problem, const std::vector<AccuracyResult>& results,
                     CsvTable* table) {
  for (const AccuracyResult& result : results) {
    AddAnswers(problem, result.models, result.poisson_ratio, table);
    AddAnswers(problem, result.references, result.poisson_ratio, table);
  }
}

CsvTable MovementSummary() {
  std::vector<std::string> header = {"case", "place"};
  for (const ModelVariant& variant : AllModelVariants()) header.push_back(variant.name);
  return CsvTable(std::move(header));
}

void AddMovementSummaryRows(const AccuracyCase& problem, const AccuracyResult& result,
                            CsvTable* table) {
  for (const SkinPlace& place : ProfileOf(problem)) {
    std::vector<std::string> cells = {problem.name, place.name};
    for (const ModelVariant& variant : AllModelVariants()) {
      const PlaceMovement m = MovementOf(problem, place, *result.Model(variant.name));
      cells.push_back(absl::StrCat(ForwardAndUp(m.foremost), "; ", ForwardAndUp(m.mean)));
    }
    table->AddRow(std::move(cells));
  }
}

}  // namespace tissueform
