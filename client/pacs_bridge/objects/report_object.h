// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/pacs_bridge/objects/prediction_input.h"
#include "core/planning/case_file/predicted_case.h"

class DcmDataset;

namespace tissueform {

// The document of a Comprehensive SR (docs/pacs.md has its tree): where it is from, how segments,
// places of the skin and landmarks move, the measures, the models and the capture. To be written
// before the common modules, which replace what it says of patient and study.
//
// Errors: Internal: DCMTK refuses it.
absl::Status WriteReportModules(const PredictionObjectsInput& input, const PredictedCase& predicted,
                                const std::string& study_uid, DcmDataset* object);

}  // namespace tissueform
