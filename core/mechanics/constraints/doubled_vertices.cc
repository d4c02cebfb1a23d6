// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/doubled_vertices.h"

#include <algorithm>
#include <numeric>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace tissueform {

absl::StatusOr<std::vector<int32_t>> FirstAtPlace(const Positions& positions,
                                                  const std::vector<ContactRow>& rows) {
  std::vector<int32_t> first(static_cast<size_t>(positions.rows()));
  std::iota(first.begin(), first.end(), 0);
  for (size_t number = 0; number < rows.size(); ++number) {
    const ContactRow& row = rows[number];
    if (row.other == ContactRow::kBone) continue;
    const auto [earlier, later] = std::minmax(row.vertex, row.other);
    if (earlier < 0 || later >= positions.rows()) {
      return absl::InvalidArgumentError(
          absl::StrCat("contact row ", number, " names vertex ", earlier < 0 ? earlier : later,
                       ", but the mesh has vertices 0 to ", positions.rows() - 1));
    }
    if (positions.row(earlier) != positions.row(later)) continue;
    int32_t& known = first[static_cast<size_t>(later)];
    known = std::min(known, earlier);
  }
  // An earlier vertex is settled before those that are joined with it.
  for (int32_t& vertex : first) vertex = first[static_cast<size_t>(vertex)];
  return first;
}

}  // namespace tissueform
