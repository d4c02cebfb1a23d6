// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/published_ratios.h"

#include <array>

namespace tissueform {
namespace {

struct Row {
  JawMove move;
  absl::string_view landmark;
  PublishedRatio ratio;
};

// The single figures of a mandible that goes back are mm of one paper over its soft pogonion's
// 6.7 mm; that of a chin is 6.72 mm of skin over 6.39 of bone (docs/outcome.md names the papers).
constexpr std::array<Row, 14> kRows = {{
    {JawMove::kMandibleForward, "labrale_inferius", {0.53, 0.66}},
    {JawMove::kMandibleForward, "soft_pogonion", {0.9, 1.0}},
    {JawMove::kMandibleBack, "labrale_superius", {0.15, 0.15}},
    {JawMove::kMandibleBack, "stomion", {0.24, 0.24}},
    {JawMove::kMandibleBack, "cheilion", {0.51, 0.51}},
    {JawMove::kMandibleBack, "labrale_inferius", {0.92, 1.05}},
    {JawMove::kMandibleBack, "sublabiale", {0.92, 1.05}},
    {JawMove::kMandibleBack, "soft_pogonion", {0.92, 1.05}},
    {JawMove::kMaxillaForward, "pronasale", {0.17, 0.17}},
    {JawMove::kMaxillaForward, "subnasale", {0.6, 0.9}},
    {JawMove::kMaxillaForward, "labrale_superius", {0.6, 1.0}},
    {JawMove::kMaxillaUp, "subnasale", {0.54, 0.91}},
    {JawMove::kMaxillaUp, "labrale_superius", {0.66, 0.97}},
    {JawMove::kChinForward, "soft_pogonion", {1.05, 1.05}},
}};

}  // namespace

std::optional<PublishedRatio> FindPublishedRatio(JawMove move, absl::string_view landmark) {
  for (const Row& row : kRows) {
    if (row.move == move && row.landmark == landmark) return row.ratio;
  }
  return std::nullopt;
}

}  // namespace tissueform
