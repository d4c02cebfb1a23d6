// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/planning/plan_building/lip_parting.h"
#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_building/skin_coverage.h"
#include "core/planning/plan_report/plan_pictures.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// The line between the lips and what they touch, as the report shows it.

// The key "mouth_line" of report.json (docs/recipe-format.md). `mouth` may be an error, whose
// message is reported.
nlohmann::ordered_json MouthJson(const absl::StatusOr<MouthLine>& mouth,
                                 const Landmarks& landmarks);

// The CT's skin about the mouth with the line and its corners on it, from the front and obliquely.
std::vector<Scene> MouthScenes(const SkinCoverage& coverage, const Landmarks& landmarks,
                               const MouthLine& mouth);
std::vector<LegendEntry> MouthLegend();

// The key "lip_contact" of report.json. Null where the lips are not parted.
nlohmann::ordered_json LipContactJson(const std::optional<PartedLips>& lips);

// What of the mesh touches jaws and the other lip, by how it does.
//
// REQUIRES: the build's lips are parted.
std::vector<Scene> LipContactScenes(const PlanBuild& build);
std::vector<LegendEntry> LipContactLegend();

}  // namespace tissueform
