// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/contact_row.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr double kRoundingOfNormals = 1e-6;

absl::Status BadRow(size_t row, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("contact row ", row, " ", what));
}

absl::Status CheckVertex(size_t row, int32_t vertex, const std::vector<bool>& is_constrained) {
  if (vertex < 0 || static_cast<size_t>(vertex) >= is_constrained.size()) {
    return BadRow(row, absl::StrCat("names vertex ", vertex, ", but the mesh has vertices 0 to ",
                                    static_cast<int64_t>(is_constrained.size()) - 1));
  }
  if (is_constrained[static_cast<size_t>(vertex)]) {
    return BadRow(row, absl::StrCat("names vertex ", vertex,
                                    ", which moves with a region; take it out of the fixed region "
                                    "and of the handles"));
  }
  return absl::OkStatus();
}

absl::Status CheckPartners(size_t number, const ContactRow& row,
                           const std::vector<bool>& is_constrained, int num_handles) {
  TF_RETURN_IF_ERROR(CheckVertex(number, row.vertex, is_constrained));
  if (row.handle != ContactRow::kFixedBone && (row.handle < 0 || row.handle >= num_handles)) {
    return BadRow(number,
                  absl::StrCat("names handle ", row.handle, ", but there are handles 0 to ",
                               num_handles - 1, "; the fixed region is ", ContactRow::kFixedBone));
  }
  if (row.other == ContactRow::kBone) return absl::OkStatus();
  TF_RETURN_IF_ERROR(CheckVertex(number, row.other, is_constrained));
  if (row.other == row.vertex) {
    return BadRow(number, absl::StrCat("lets vertex ", row.vertex, " touch itself"));
  }
  if (row.handle != ContactRow::kFixedBone) {
    return BadRow(number, "names a handle between two vertices; leave the handle out");
  }
  return absl::OkStatus();
}

absl::Status CheckNumbers(size_t number, const ContactRow& row) {
  if (!(std::abs(row.normal.norm() - 1) <= kRoundingOfNormals)) {
    return BadRow(number,
                  absl::StrCat("has a normal of length ", row.normal.norm(), "; it must be 1"));
  }
  if (!std::isfinite(row.gap_mm) || row.gap_mm < 0) {
    return BadRow(number,
                  absl::StrCat("has a gap of ", row.gap_mm, " mm; at rest it must be 0 or more"));
  }
  if (!row.bilateral) return absl::OkStatus();
  if (row.other != ContactRow::kBone) {
    return BadRow(number, "is bilateral between two vertices; only tissue on bone may be");
  }
  if (row.gap_mm != 0) {
    return BadRow(number, absl::StrCat("is bilateral with a gap of ", row.gap_mm,
                                       " mm; let it be unilateral, or its gap 0"));
  }
  return absl::OkStatus();
}

// Against the rows before it of the same vertex.
absl::Status CheckAgainst(size_t number, const ContactRow& row, size_t other_number,
                          const ContactRow& other) {
  const double cosine = row.normal.dot(other.normal);
  if (row.bilateral && other.bilateral && std::abs(cosine) > kRoundingOfNormals) {
    return BadRow(number, absl::StrCat("and row ", other_number,
                                       " are bilateral at one vertex and not orthogonal"));
  }
  const bool same_partner = row.other == other.other && row.handle == other.handle;
  if (same_partner && row.bilateral == other.bilateral && cosine > 1 - kRoundingOfNormals) {
    return BadRow(number, absl::StrCat("repeats row ", other_number));
  }
  return absl::OkStatus();
}

absl::Status CheckNumberOfRows(const std::vector<ContactRow>& rows) {
  if (rows.size() > kMaxContactRows) {
    return absl::InvalidArgumentError(
        absl::StrCat("there are ", rows.size(), " contact rows; the limit is ", kMaxContactRows));
  }
  const auto lifting = static_cast<size_t>(
      std::ranges::count_if(rows, [](const ContactRow& row) { return !row.bilateral; }));
  if (lifting <= kMaxUnilateralRows) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("there are ", lifting,
                                                 " contact rows that are not bilateral; the limit "
                                                 "is ",
                                                 kMaxUnilateralRows));
}

}  // namespace

absl::Status CheckContactRows(const std::vector<ContactRow>& rows,
                              const std::vector<bool>& is_constrained, int num_handles) {
  TF_RETURN_IF_ERROR(CheckNumberOfRows(rows));
  std::map<int32_t, std::vector<size_t>> of_vertex;
  for (size_t number = 0; number < rows.size(); ++number) {
    const ContactRow& row = rows[number];
    TF_RETURN_IF_ERROR(CheckPartners(number, row, is_constrained, num_handles));
    TF_RETURN_IF_ERROR(CheckNumbers(number, row));
    std::vector<size_t>& before = of_vertex[row.vertex];
    for (const size_t other : before) {
      TF_RETURN_IF_ERROR(CheckAgainst(number, row, other, rows[other]));
    }
    before.push_back(number);
  }
  return absl::OkStatus();
}

}  // namespace tissueform
