// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "nlohmann/json_fwd.hpp"
#include <Eigen/Core>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/planning/plan.h"

namespace tissueform {

// Values that plans and recipes write in the same way. REQUIRES: the JSON has passed the schema.

// [x, y, z]
Eigen::Vector3d VectorFromJson(const nlohmann::json& json);
nlohmann::json ToJson(const Eigen::Vector3d& vector);

// One of the selectors (docs/plan-format.md).
VertexSelector SelectorFromJson(const nlohmann::json& json);

// A pose of a handle (docs/plan-format.md); what is left out is the identity's.
HandlePose PoseFromJson(const nlohmann::json& json);
nlohmann::json ToJson(const HandlePose& pose);

}  // namespace tissueform
