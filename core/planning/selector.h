// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"
#include "core/planning/plan.h"

namespace tissueform {

// What selectors look at. `positions` are in the coordinate system of the plan.
struct SelectionSource {
  const Positions& positions;
  const std::vector<Attribute>& point_data;
};

// The vertices that `selector` names, rising and without repetition. `region` ("fixed", "handle
// \"chin\"") begins every message.
//
// Errors (InvalidArgument): a vertex that the mesh does not have, a point array that is missing or
// has more than one component, a box whose min lies above its max, or no vertex at all.
absl::StatusOr<std::vector<int32_t>> ResolveSelector(const VertexSelector& selector,
                                                     const SelectionSource& source,
                                                     const std::string& region);

// The same box from `system` in LPS or back: min and max change places where the sign does.
SelectBox SwapToOrFromLps(CoordinateSystem system, const SelectBox& box);

}  // namespace tissueform
