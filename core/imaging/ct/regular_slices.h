// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <vector>

namespace tissueform {

// Slices by their heights alone: which lie at the steps of one scan, and what fits between them.

// A slice and where it lies.
struct Placed {
  double height_mm = 0;
  size_t slice = 0;
};
using Stack = std::vector<Placed>;  // rising

// By height; slices at one place stay in their order.
Stack Sorted(Stack stack);

bool AreAtOnePlace(const Placed& lower, const Placed& upper);

// The longest chain of slices at regular steps, where a change of step costs about half a slice:
// true for the slices in it. Of all slices where nothing is wrong.
std::vector<bool> OnRegularSteps(const Stack& stack);

// Whether all slices are in that chain, and no two at one place.
bool IsRegular(const Stack& stack);

// Whether all slices of a part lie outside of the stack, or in its holes.
bool FitsInto(const Stack& part, const Stack& stack);

}  // namespace tissueform
