// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/mesh_defect.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace tissueform {
namespace {

struct Unit {
  const char* name;
  double mm;
};
// In which meshes are saved by mistake; the likeliest first.
constexpr std::array<Unit, 3> kOtherUnits = {
    {{"meters", 1000}, {"centimeters", 10}, {"micrometers", 0.001}}};

bool MayBeOfHead(double diagonal_mm) {
  return diagonal_mm >= kLeastHeadDiagonalMm && diagonal_mm <= kMaxHeadDiagonalMm;
}

// For the unit that makes a head of it.
std::string UnitAdvice(double diagonal) {
  for (const Unit& unit : kOtherUnits) {
    if (!MayBeOfHead(diagonal * unit.mm)) continue;
    return absl::StrFormat("; if the file is in %s, multiply its coordinates by %g", unit.name,
                           unit.mm);
  }
  return "; check the unit of the file";
}

}  // namespace

void AddDefect(const DefectWords& words, const std::vector<Eigen::Index>& found,
               std::vector<MeshDefect>* defects) {
  if (found.empty()) return;
  MeshDefect defect;
  defect.kind = words.kind;
  defect.severity = words.severity;
  defect.count = static_cast<Eigen::Index>(found.size());
  const size_t shown = std::min(found.size(), MeshDefect::kMaxExamples);
  defect.examples.assign(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(shown));
  defect.explanation = absl::StrCat(defect.count, " ", words.what, " (", words.noun, " ",
                                    absl::StrJoin(defect.examples, ", "),
                                    found.size() > shown ? ", ..." : "", "): ", words.advice);
  defects->push_back(std::move(defect));
}

std::optional<MeshDefect> FindImplausibleSize(const Positions& positions) {
  if (positions.rows() == 0 || !positions.allFinite()) return std::nullopt;
  const double diagonal_mm =
      (positions.colwise().maxCoeff() - positions.colwise().minCoeff()).norm();
  if (MayBeOfHead(diagonal_mm)) return std::nullopt;
  MeshDefect defect{"implausible_size", Severity::kWarning, 1, {}, ""};
  const bool is_small = diagonal_mm < kLeastHeadDiagonalMm;
  defect.explanation = absl::StrFormat(
      "the diagonal of the bounding box is %.4g mm, %s than %.4g mm%s", diagonal_mm,
      is_small ? "less" : "more", is_small ? kLeastHeadDiagonalMm : kMaxHeadDiagonalMm,
      UnitAdvice(diagonal_mm));
  return defect;
}

void AddImplausibleSize(const Positions& positions, std::vector<MeshDefect>* defects) {
  if (std::optional<MeshDefect> size = FindImplausibleSize(positions)) {
    defects->push_back(*std::move(size));
  }
}

bool AreUsable(const std::vector<MeshDefect>& defects) {
  return std::none_of(defects.begin(), defects.end(),
                      [](const MeshDefect& d) { return d.severity == Severity::kError; });
}

const MeshDefect* FindDefect(const std::vector<MeshDefect>& defects, std::string_view kind) {
  const auto found = std::find_if(defects.begin(), defects.end(),
                                  [&](const MeshDefect& d) { return d.kind == kind; });
  return found == defects.end() ? nullptr : &*found;
}

absl::Status CheckDefects(const std::vector<MeshDefect>& defects) {
  const auto is_error = [](const MeshDefect& d) { return d.severity == Severity::kError; };
  const auto first = std::find_if(defects.begin(), defects.end(), is_error);
  if (first == defects.end()) return absl::OkStatus();
  std::string message = absl::StrCat("mesh is not usable: ", first->explanation);
  const auto further = std::count_if(first + 1, defects.end(), is_error);
  if (further > 0) {
    absl::StrAppend(&message, " (and ", further, " more kinds of defect; see `mesh check`)");
  }
  return absl::InvalidArgumentError(message);
}

}  // namespace tissueform
