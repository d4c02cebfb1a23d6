// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What the poses of a plan do, for people: "mandible 8 mm forward", "tip turned by 20 degrees",
// several handles joined by "; ". Directions are named for the patient where a move is along one
// axis of LPS.
std::string MovesInWords(const PlanProblem& problem);

}  // namespace tissueform
