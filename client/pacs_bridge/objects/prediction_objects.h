// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/objects/prediction_input.h"

namespace tissueform {

struct WrittenObject {
  std::string key = {};  // of ObjectKeys
  std::string path = {};
  std::string class_uid = {};
  std::string instance_uid = {};
  std::string series_uid = {};
};

// Writes a prediction as DICOM objects of the study that its case came from (docs/pacs.md says
// which tags), each a file INSTANCE_UID.dcm in `folder`, which is there: readable by its owner
// alone, explicit little endian, synced. The same input writes the same bytes; files that are there
// are replaced. What is written before an error stays.
//
// The texts of patient and study are copied byte for byte with their character set; our own are
// ASCII.
//
// Errors: those of CheckPredictionInput, PredictCase, LoadDicomHeader, CheckSource,
// ReadCaptureFrames and SaveDicomFile.
absl::StatusOr<std::vector<WrittenObject>> WritePredictionObjects(
    const PredictionObjectsInput& input, const std::string& folder);

}  // namespace tissueform
