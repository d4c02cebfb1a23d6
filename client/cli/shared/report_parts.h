// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/mesh/attribute.h"
#include "core/mesh/mesh_defect.h"

namespace tissueform {

// What reports have in common.

// "anatomy (int32), normal (float32 x 3)", or "none".
std::string ArraysText(const std::vector<Attribute>& attributes);
nlohmann::ordered_json ArraysJson(const std::vector<Attribute>& attributes);

// One line per defect, or one that says that the mesh has no defects.
std::string DefectsText(const std::vector<MeshDefect>& defects);
nlohmann::ordered_json DefectsJson(const std::vector<MeshDefect>& defects);

// Prints a report for programs on stdout.
void PrintJsonReport(const nlohmann::ordered_json& json);

// Prints the one or the other on stdout.
void PrintReport(bool as_json, const std::string& text, const nlohmann::ordered_json& json);

}  // namespace tissueform
