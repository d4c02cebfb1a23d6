// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

#include "absl/strings/string_view.h"

namespace tissueform {

// One direction in which an operation moves one jaw or the chin.
enum class JawMove { kMandibleForward, kMandibleBack, kMaxillaForward, kMaxillaUp, kChinForward };

// How far a skin point moves for each mm of its bone, along the bone's movement, as printed.
struct PublishedRatio {
  double low = 0;
  double high = 0;  // equal to `low` where only one figure is printed: then it is not a range

  bool IsRange() const { return low < high; }
  double Middle() const { return (low + high) / 2; }
};

// The range of the papers that docs/outcome.md lists, for a landmark by its name in
// docs/measures.md
// ("stomion" and "cheilion" besides); empty where none is known.
std::optional<PublishedRatio> FindPublishedRatio(JawMove move, absl::string_view landmark);

}  // namespace tissueform
