// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_case_list.h"

#include <array>

#include "absl/strings/str_cat.h"

#include "client/lab/accuracy/layered_block.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kBarCells = 8;

struct BundledCase {
  const char* name;
  const char* title;
  const char* plan;
};

constexpr std::array<BundledCase, 4> kBundled = {{
    {"tongue", "bundled tongue, tip turned by 20\u00b0", "tongue"},
    {"head_mandible", "real head, mandible advanced by 6 mm", "head"},
    {"head_maxilla", "real head, maxilla moved 5 mm up and turned by 3\u00b0", "head_maxilla"},
    {"head_chin", "real head, chin advanced by 4 mm", "head_chin"},
}};

}  // namespace

const std::vector<std::string>& AccuracyCaseNames() {
  static const auto* const kNames = [] {
    auto* names = new std::vector<std::string>{"bar_bend", "bar_twist", "block_along", "block_up"};
    for (const BundledCase& bundled : kBundled) names->emplace_back(bundled.name);
    return names;
  }();
  return *kNames;
}

absl::StatusOr<AccuracyCase> CreateAccuracyCase(const std::string& name,
                                                const PlanFinder& find_plan) {
  if (name == "bar_bend") return BendCase(kBarCells);
  if (name == "bar_twist") return TwistAndStretchCase(kBarCells);
  if (name == "block_along") return BlockAlongCase(kLayeredBlockCells);
  if (name == "block_up") return BlockUpCase(kLayeredBlockCells);
  for (const BundledCase& bundled : kBundled) {
    if (name != bundled.name) continue;
    TF_ASSIGN_OR_RETURN(const std::string path, find_plan(bundled.plan));
    return CaseOfPlan(name, bundled.title, path);
  }
  return absl::NotFoundError(absl::StrCat("unknown case \"", name, "\""));
}

}  // namespace tissueform
