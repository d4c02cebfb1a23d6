// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/plan.h"

namespace tissueform {

// Of a plan's mesh with contact, on vertices, as numbers of one byte: 1 slides on bone, 2 meets
// bone, 4 meets the other lip, and their sums.
inline constexpr char kContactArray[] = "contact";

// The key "contact" of a plan. REQUIRES: it has passed the schema.
std::vector<PlannedContactRow> ContactFromJson(const nlohmann::json& contact);

// The same key from rows in LPS, for a plan that is written in `system` with these handles.
// REQUIRES: the rows name no other handles.
nlohmann::json ContactToJson(const std::vector<ContactRow>& rows,
                             const std::vector<std::string>& handles, CoordinateSystem system);

// The plan's rows in LPS, their handles by their places in the plan. Vertices and normals are
// checked by ConstraintSet. Errors: InvalidArgument, naming the row, for an unknown handle.
absl::StatusOr<std::vector<ContactRow>> ResolveContact(const Plan& plan);

// The key "seal" of "contact", in the same coordinate system. REQUIRES: it has passed the schema.
LipEdge LipEdgeFromJson(const nlohmann::json& seal);
nlohmann::json LipEdgeToJson(const LipEdge& edge, CoordinateSystem system);  // of an edge in LPS

// The plan's edge of the lips in LPS, if it has one. Errors: those of CheckLipEdge.
absl::StatusOr<std::optional<LipEdge>> ResolveLipEdge(const Plan& plan, const Positions& rest,
                                                      const std::vector<ContactRow>& rows);

// Takes the vertices that the rows name out of the regions, and says where they were.
//
// Errors: InvalidArgument when nothing is left of a region.
absl::StatusOr<std::vector<FreedVertex>> FreeTouchingVertices(const std::vector<ContactRow>& rows,
                                                              std::vector<int32_t>* fixed,
                                                              std::vector<HandleRegion>* handles);

}  // namespace tissueform
