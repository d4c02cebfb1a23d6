// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/problem/contact_summary.h"

#include <algorithm>

namespace tissueform {
namespace {

constexpr double kNewtonsPerPaMm2 = 1e-6;

}  // namespace

std::optional<ContactSummary> SummarizeContact(const ContactAnswer& contact,
                                               DeformationModel model) {
  if (contact.forces.empty()) return std::nullopt;
  ContactSummary summary{.rows = static_cast<int64_t>(contact.forces.size()),
                         .pressing_rows = std::ranges::count_if(
                             contact.forces, [](double force) { return force > 0; }),
                         .max_force_n = std::nullopt,
                         .residual_mm = contact.residual_mm};
  if (TraitsOf(model).is_elastic) {
    summary.max_force_n = kNewtonsPerPaMm2 * std::ranges::max(contact.forces);
  }
  return summary;
}

}  // namespace tissueform
