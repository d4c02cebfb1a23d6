// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/tissue_ranges.h"

#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kFactorKey[] = "uncertainty/youngs_modulus_factor_95";

// One number a tet, equal where the tissue is, and what to call it.
struct Labels {
  std::vector<double> of_tet;
  std::string before;  // the number
  std::string after;
};

absl::StatusOr<Labels> LabelsOfArray(const std::string& name,
                                     const std::vector<Attribute>& cell_data) {
  TF_ASSIGN_OR_RETURN(std::vector<double> labels, FindScalars(cell_data, name, "cell"));
  return Labels{std::move(labels), absl::StrCat(name, " "), ""};
}

absl::StatusOr<Labels> LabelsOf(const Plan& plan, const Eigen::VectorXd& stiffness,
                                const std::vector<Attribute>& cell_data) {
  const PlannedUncertainty& planned = *plan.uncertainty;
  if (const auto* chosen = std::get_if<FactorByCellData>(&planned.youngs_modulus_factor_95)) {
    return LabelsOfArray(chosen->name, cell_data);
  }
  if (const auto* labelled = std::get_if<StiffnessByCellData>(&plan.stiffness)) {
    return LabelsOfArray(labelled->name, cell_data);
  }
  if (FindAttribute(cell_data, kTissueArray) != nullptr) {
    return LabelsOfArray(kTissueArray, cell_data);
  }
  return Labels{{stiffness.begin(), stiffness.end()}, "", " Pa"};
}

absl::StatusOr<double> FactorOf(const PlannedUncertainty& planned, double label, size_t tet) {
  const auto* chosen = std::get_if<FactorByCellData>(&planned.youngs_modulus_factor_95);
  if (chosen == nullptr) return std::get<double>(planned.youngs_modulus_factor_95);
  for (const auto& [value, factor] : chosen->factor_of_value) {
    if (static_cast<double>(value) == label) return factor;
  }
  return absl::InvalidArgumentError(absl::StrCat(kFactorKey, ": tet ", tet, " has ", chosen->name,
                                                 " = ", label,
                                                 ", which has no factor; add it to values"));
}

// In the order of their labels.
absl::StatusOr<MaterialUncertainty> TissuesOf(const PlannedUncertainty& planned,
                                              const Labels& labels) {
  MaterialUncertainty uncertainty;
  std::map<double, int32_t> tissue_of_label;
  for (size_t t = 0; t < labels.of_tet.size(); ++t) {
    const double label = labels.of_tet[t];
    if (std::isnan(label)) {  // which a map does not find again
      return absl::InvalidArgumentError(
          absl::StrCat(kFactorKey, ": the label of tet ", t, " is not a number"));
    }
    if (!tissue_of_label.emplace(label, 0).second) continue;
    TF_RETURN_IF_ERROR(FactorOf(planned, label, t).status());
    if (tissue_of_label.size() > kMaxTissues) {
      return absl::InvalidArgumentError(
          absl::StrCat(kFactorKey, ": more than ", kMaxTissues,
                       " kinds of tissue; use a cell array of labels (by_cell_data) with fewer"));
    }
  }
  for (auto& [label, tissue] : tissue_of_label) {
    tissue = static_cast<int32_t>(uncertainty.tissues.size());
    TF_ASSIGN_OR_RETURN(const double factor, FactorOf(planned, label, /*tet=*/0));
    uncertainty.tissues.push_back({absl::StrCat(labels.before, label, labels.after), factor});
  }
  for (const double label : labels.of_tet) {
    uncertainty.tissue_of_tet.push_back(tissue_of_label.at(label));
  }
  return uncertainty;
}

absl::Status CheckPoissonRange(const Plan& plan) {
  const auto& range = plan.uncertainty->poisson_ratio_95;
  if (!range || ((*range)[0] < (*range)[1] && (*range)[0] <= plan.poisson_ratio &&
                 plan.poisson_ratio <= (*range)[1])) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("uncertainty/poisson_ratio_95: [", (*range)[0], ", ", (*range)[1],
                   "] must be ascending and contain poisson_ratio, which is ", plan.poisson_ratio));
}

}  // namespace

absl::StatusOr<std::optional<MaterialUncertainty>> ResolveUncertainty(
    const Plan& plan, const Eigen::VectorXd& stiffness, const std::vector<Attribute>& cell_data) {
  if (!plan.uncertainty) return std::nullopt;
  TF_RETURN_IF_ERROR(CheckPoissonRange(plan));
  const absl::StatusOr<Labels> labels = LabelsOf(plan, stiffness, cell_data);
  if (!labels.ok()) {
    return absl::Status(labels.status().code(),
                        absl::StrCat(kFactorKey, ": ", labels.status().message()));
  }
  TF_ASSIGN_OR_RETURN(MaterialUncertainty uncertainty, TissuesOf(*plan.uncertainty, *labels));
  uncertainty.poisson_ratio_95 = plan.uncertainty->poisson_ratio_95;
  return uncertainty;
}

}  // namespace tissueform
