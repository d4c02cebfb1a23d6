// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>

#include "core/mechanics/deformation/deformer.h"

namespace tissueform {

// How tissue touches in an answer, over the contact rows that are not bilateral.
struct ContactSummary {
  int64_t rows = 0;
  int64_t pressing_rows = 0;  // those with a force
  double max_force_n = 0;     // largest force of a row
  double residual_mm = 0;     // ContactAnswer::residual_mm

  friend bool operator==(const ContactSummary&, const ContactSummary&) = default;
};

// Nothing where the answer has no such rows.
std::optional<ContactSummary> SummarizeContact(const ContactAnswer& contact);

}  // namespace tissueform
