// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"

namespace tissueform {

// Vertices that reports treat as one place.
struct SkinPlace {
  std::string name;
  std::vector<int32_t> vertices;  // at least one, rising
};

// The places on a head's skin by the point array "skin_region" that `tissueform plan build` writes:
// those of kNamedSkinRegions (core/mesh/skin_region.h) that have a vertex, by their names and in
// that order, and after them "face", all of these together. None when the mesh has no such array.
//
// Errors: InvalidArgument when the array has more than one component.
absl::StatusOr<std::vector<SkinPlace>> SkinPlaces(const std::vector<Attribute>& point_data);

// The one of `vertices` that lies foremost: smallest y of `positions` (#V by 3, LPS); of equals the
// first. REQUIRES: there is one.
int32_t ForemostVertex(const Positions& positions, const std::vector<int32_t>& vertices);

// Null when no place has that name.
const SkinPlace* FindPlace(const std::vector<SkinPlace>& places, absl::string_view name);

}  // namespace tissueform
