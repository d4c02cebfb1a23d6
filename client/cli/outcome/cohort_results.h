// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "client/cli/outcome/cohort_list.h"
#include "client/cli/outcome/cohort_runs.h"
#include "core/planning/outcome/distance_statistics.h"

namespace tissueform {

// What several tables group by.
struct CohortGroup {
  std::string operation;
  std::string movement;  // "real", "planned" or "none"
  std::string model;     // "none": the pre-operative face
};

// One region of one prediction of one case: from the predicted face to the operated one.
struct CohortDistance {
  std::string id;
  CohortGroup group;
  std::string region;
  double compared_share = 0;
  DistanceStatistics skin;  // positive: the operated face is in front
};

// How far one landmark of one case moved along one direction.
struct CohortLandmark {
  CohortGroup group;
  std::string landmark;
  std::string direction;  // "forward" or "up"
  double predicted_mm = 0;
  double real_mm = 0;
};

// One number of how far one segment of one case missed its plan.
struct CohortDeviation {
  std::string operation;
  std::string segment;
  std::string number;  // a key of outcome.json: "forward_mm", "pitch_deg", ...
  double value = 0;
};

// The error of one region of one case with one setting of the model.
struct CohortSetting {
  std::string id;
  std::string operation;
  std::string movement;
  std::string settings;  // their JSON, by which they are equal
  std::string region;
  double mean_absolute_mm = 0;
};

struct CohortRefusal {
  std::string id;
  std::string operation;
  std::string reason;
};

struct CohortResults {
  std::vector<CohortCase> compared;
  std::vector<CohortRefusal> refused;
  std::vector<CohortDistance> distances;
  std::vector<CohortLandmark> landmarks;
  std::vector<CohortDeviation> deviations;
  std::vector<CohortSetting> settings;  // of cases that were compared with --calibrate
};

// Reads outcome.json of every case that has a result; `runs` are those of the cases. Errors: those
// of ReadJsonText; DataLoss where a file is not as `tissueform outcome` writes it.
absl::StatusOr<CohortResults> ReadCohortResults(const std::vector<CohortCase>& cases,
                                                const std::vector<CohortRun>& runs,
                                                const std::string& out);

// What cohort.json holds (docs/outcome.md).
nlohmann::ordered_json CohortJson(const CohortResults& results);

// One row a distance. Errors: those of WriteFileAtomically.
absl::Status WriteCohortCsv(const std::string& path, const CohortResults& results);

// The page of the same: tables of `json`, which is CohortJson of `results`, and plots.
std::string CohortHtml(const CohortResults& results, const nlohmann::ordered_json& json);

}  // namespace tissueform
