// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/model.h"

#include <array>
#include <cstddef>

namespace tissueform {
namespace {

// The row of a model stands at the value of its enumerator.
constexpr std::array<ModelTraits, 4> kModels = {{
    {.model = DeformationModel::kGradientField,
     .name = "gradient_field",
     .iterates = false,
     .is_elastic = false,
     .has_prepared_answers = true,
     .has_prepared_contact = false},
    {.model = DeformationModel::kArap,
     .name = "arap",
     .iterates = true,
     .is_elastic = false,
     .has_prepared_answers = false,
     .has_prepared_contact = false},
    {.model = DeformationModel::kLinearElastic,
     .name = "linear_elastic",
     .iterates = false,
     .is_elastic = true,
     .has_prepared_answers = true,
     .has_prepared_contact = true},
    {.model = DeformationModel::kNeoHookean,
     .name = "neo_hookean",
     .iterates = true,
     .is_elastic = true,
     .has_prepared_answers = true,
     .has_prepared_contact = false},
}};

constexpr bool RowsStandAtTheirModels() {
  for (size_t row = 0; row < kModels.size(); ++row) {
    if (static_cast<size_t>(kModels.at(row).model) != row) return false;
  }
  return true;
}
static_assert(RowsStandAtTheirModels());

}  // namespace

absl::Span<const ModelTraits> AllModels() { return kModels; }

const ModelTraits& TraitsOf(DeformationModel model) {
  return kModels.at(static_cast<size_t>(model));
}

}  // namespace tissueform
