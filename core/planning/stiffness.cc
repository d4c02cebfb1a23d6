// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/stiffness.h"

#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::StatusOr<std::vector<double>> Resolve(const UniformStiffness& choice, Eigen::Index num_tets,
                                            const std::vector<Attribute>&) {
  return std::vector<double>(static_cast<size_t>(num_tets), choice.pa);
}

absl::StatusOr<std::vector<double>> Resolve(const StiffnessFromCellData& choice, Eigen::Index,
                                            const std::vector<Attribute>& cell_data) {
  return FindScalars(cell_data, choice.name, "cell");
}

absl::StatusOr<std::vector<double>> Resolve(const StiffnessByCellData& choice, Eigen::Index,
                                            const std::vector<Attribute>& cell_data) {
  TF_ASSIGN_OR_RETURN(std::vector<double> values, FindScalars(cell_data, choice.name, "cell"));
  // Labels come as any type of number, floats among them. As doubles whole numbers stay
  // themselves up to 2^53.
  std::map<double, double> pa_of_value;
  for (const auto& [label, pa] : choice.pa_of_value) pa_of_value[static_cast<double>(label)] = pa;
  for (size_t t = 0; t < values.size(); ++t) {
    // A NaN is not less than any key nor any key than it: the map would take it for its first one.
    const auto found = std::isnan(values[t]) ? pa_of_value.end() : pa_of_value.find(values[t]);
    if (found == pa_of_value.end()) {
      return absl::InvalidArgumentError(absl::StrCat("tet ", t, " has ", choice.name, " = ",
                                                     values[t],
                                                     ", which has no stiffness; add it to values"));
    }
    values[t] = found->second;
  }
  return values;
}

}  // namespace

absl::StatusOr<Eigen::VectorXd> ResolveStiffness(const StiffnessChoice& choice,
                                                 Eigen::Index num_tets,
                                                 const std::vector<Attribute>& cell_data) {
  absl::StatusOr<std::vector<double>> pa =
      std::visit([&](const auto& kind) { return Resolve(kind, num_tets, cell_data); }, choice);
  if (!pa.ok()) {
    return absl::Status(pa.status().code(), absl::StrCat("stiffness: ", pa.status().message()));
  }
  for (size_t t = 0; t < pa->size(); ++t) {
    if (!std::isfinite((*pa)[t]) || (*pa)[t] <= 0) {
      return absl::InvalidArgumentError(absl::StrCat("stiffness: tet ", t, " has ", (*pa)[t],
                                                     " Pa; it must be positive and finite"));
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(pa->data(), num_tets);
}

}  // namespace tissueform
