// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

#include "core/mechanics/uncertainty/surgery_expansion.h"

namespace tissueform {

// By how much surgery and the model err: standard deviations. The defaults are published figures
// of any operation.
struct Deviations {
  SurgeryDeviation surgery;
  // By which a predicted place of the skin is off along its normal though bone lies as assumed:
  // lower and upper lip 1.2 mm of mean absolute deviation, elsewhere a median of 0.60 mm
  // (docs/accuracy.md, "The whole band"). Places by their names in the mesh.
  double model_mm = 0.89;
  std::map<std::string, double> model_of_place_mm = {{"lower_lip", 1.5}, {"upper_lip", 1.5}};
  std::string source = "published";

  double ModelOf(const std::string& place) const;
};

// Of all operations together, and of those that have figures of their own.
struct DeviationTable {
  Deviations all;
  std::map<std::string, Deviations> operations;
};

// As printed. Of one operation alone there are figures for the lower jaw moved forward.
DeviationTable PublishedDeviations();

inline constexpr size_t kLongestOperationName = 64;
// Letters, digits, - and _.
bool IsOperationName(absl::string_view name);

// A JSON file (docs/deviations.schema.json): {"surgery": {"translation_mm": [left, back, up],
// "rotation_deg": [...]}, "model_mm": {"default": 0.9, "chin": 1.1}, "source": "our clinic, 40
// patients", "operations": {"bsso": {"model_mm": {"chin": 0.8}}}}. What it leaves out is as
// published, what an operation leaves out as of all operations of the file. Errors: InvalidArgument
// with the file's name for anything else.
absl::StatusOr<DeviationTable> ReadDeviations(const std::string& path);

// Those of the operation; of all operations where `operation` is empty. Errors: InvalidArgument
// with the known names where the table has none of this name.
absl::StatusOr<Deviations> DeviationsOf(const DeviationTable& table, const std::string& operation);

// As ReadDeviations reads it, without operations.
nlohmann::ordered_json DeviationsToJson(const Deviations& deviations);
// As ReadDeviations reads it, with nothing left out.
nlohmann::ordered_json DeviationTableToJson(const DeviationTable& table);

}  // namespace tissueform
