// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>

#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/model.h"

namespace tissueform {

// How tissue touches in an answer, over the contact rows that are not bilateral.
struct ContactSummary {
  int64_t rows = 0;
  int64_t pressing_rows = 0;  // those with a force
  // Largest force of a row; only of elastic models, as the others know where contact is, but not
  // how strong.
  std::optional<double> max_force_n;
  double residual_mm = 0;  // ContactAnswer::residual_mm

  friend bool operator==(const ContactSummary&, const ContactSummary&) = default;
};

// Nothing where the answer has no such rows.
std::optional<ContactSummary> SummarizeContact(const ContactAnswer& contact,
                                               DeformationModel model);

}  // namespace tissueform
