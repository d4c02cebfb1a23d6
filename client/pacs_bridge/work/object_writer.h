// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/received_rows.h"
#include "client/pacs_bridge/work/case_server.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// What an export is written from.
struct ExportMaterial {
  std::string header = {};      // file: of one of the source images, without pixels
  std::string series_uid = {};  // of the source series
  std::vector<QueuedImage> sources = {};
  std::string case_path = {};
  CaseFile case_file = {};
  ServedPrediction prediction = {};
  std::vector<double> band_mm = {};              // PredictionObjectsInput::band_mm
  v1::Export asked = {};                         // with its measures
  std::map<std::string, std::string> uids = {};  // by key: of objects and of their series
  std::string pictures = {};                     // folder of what Draw has drawn
  std::string folder = {};                       // empty; for the files
};

// An object that was written.
struct ExportFile {
  std::string key = {};  // whose UID it has
  std::string path = {};
};

// Makes the DICOM objects of a prediction. Any thread.
class ObjectWriter {
 public:
  virtual ~ObjectWriter() = default;

  // The keys for which there must be UIDs before anything is written: of objects, and of what they
  // are in ("series:..."), which are never sent themselves.
  virtual absl::StatusOr<std::vector<std::string>> KeysOf(const ExportMaterial& material) = 0;

  // Draws the prediction for the person who confirms it: PNG files in `folder`, which does not
  // exist yet. Of the material, only case and prediction are needed.
  virtual absl::Status Draw(const ExportMaterial& material, const std::string& folder) = 0;

  // Errors: InvalidArgument (case and prediction do not fit), those of the disk.
  virtual absl::StatusOr<std::vector<ExportFile>> Write(const ExportMaterial& material) = 0;
};

}  // namespace tissueform
