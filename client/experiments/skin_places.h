// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"

namespace tissueform {

// Vertices that are told of together.
struct SkinPlace {
  std::string name;
  std::vector<int32_t> vertices;  // at least one, rising
};

// The places on a head's skin by the point array "skin_region" that `tissueform plan build` writes:
// upper_lip, lower_lip, chin, nose, cheek_left, cheek_right, those that have a vertex, and after
// them "face", all of these together. None when the mesh has no such array.
//
// Errors: InvalidArgument when the array has more than one component.
absl::StatusOr<std::vector<SkinPlace>> SkinPlaces(const std::vector<Attribute>& point_data);

// The vertex of the place that lies foremost: smallest y, as LPS has it.
int32_t ForemostVertex(const Positions& positions, const SkinPlace& place);

// Null when there is none of that name.
const SkinPlace* FindPlace(const std::vector<SkinPlace>& places, const std::string& name);

}  // namespace tissueform
