// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/skin_coverage.h"
#include "core/planning/plan_report/input_words.h"
#include "core/planning/plan_report/plan_measures.h"
#include "core/planning/plan_report/plan_pictures.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What the report states about the skin of the CT, or the given one, that the mesh has or lacks.

// 99 % of every region and of the whole within the tolerance, no large gap, no hole.
std::vector<QualityCheck> CheckCoverage(const SkinCoverage& coverage, const InputWords& words = {});

// A sentence for every region and gap that misses a requirement, and one when bone lies in the
// mesh's skin: place and millimetres.
std::vector<std::string> CoverageCautions(const SkinCoverage& coverage,
                                          const InputWords& words = {});

// One text if the scanner's circle, a side of the CT or an opening of the given skin cuts what is
// modelled: how many places,
// where the largest is, how many mm2, of which regions, and that the skin there is not judged.
std::vector<std::string> CutCautions(const SkinCoverage& coverage, const InputWords& words = {});

// Whether the nose, or a part of it, is cut off so: its prominence then means nothing.
bool NoseIsCut(const SkinCoverage& coverage);

// The key "coverage" of report.json (docs/recipe-format.md).
nlohmann::ordered_json CoverageJson(const SkinCoverage& coverage, const InputWords& words = {});

// The CT's skin, what is missing in red, from the front and both sides, and what its colours mean.
std::vector<Scene> CoverageScenes(const SkinCoverage& coverage);
std::vector<LegendEntry> CoverageLegend(const SkinCoverage& coverage, const InputWords& words = {});

}  // namespace tissueform
