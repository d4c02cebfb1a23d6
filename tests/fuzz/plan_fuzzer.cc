// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstdlib>
#include <string_view>

#include "core/planning/plan_io.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

void Require(bool promise) {
  if (!promise) std::abort();
}

void CheckPromises(const Plan& plan) {
  Require(!plan.handles.empty());
  Require(plan.poisson_ratio >= 0 && plan.poisson_ratio < 0.5);
  for (const PlannedHandle& handle : plan.handles) {
    Require(handle.pose.scale > 0);
    Require(handle.pose.rotation_vector.allFinite() && handle.pose.translation_mm.allFinite());
  }
}

// One line that a terminal and a log can show.
void CheckMessage(std::string_view message) {
  Require(!message.empty());
  Require(message.find("fuzzed.json") != std::string_view::npos);
}

}  // namespace

void FuzzPlan(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<Plan> plan = ParsePlan(text, "folder", "fuzzed.json");
  if (plan.ok()) {
    CheckPromises(*plan);
  } else {
    CheckMessage({plan.status().message().data(), plan.status().message().size()});
  }
}

}  // namespace tissueform::fuzz
