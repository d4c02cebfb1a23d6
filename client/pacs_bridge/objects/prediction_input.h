// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/planning/case_file/case_file.h"
#include "tissueform/v1/export_service.pb.h"
#include "tissueform/v1/prediction.pb.h"

namespace tissueform {

// Largest sizes that are taken.
inline constexpr size_t kMaxSourceImages = 20'000;
inline constexpr size_t kMaxPictures = 8;
inline constexpr int kMaxReportedMeasures = 64;

// Said in every object.
inline constexpr char kResearchNotice[] = "Research, not a medical device";

struct SourceImage {
  std::string class_uid = {};
  std::string instance_uid = {};
};

// A prediction and the study that it goes back into. Everything is in LPS and mm, which are the
// axes and the unit of the source series' frame of reference: a case keeps the places of its CT.
struct PredictionObjectsInput {
  // A DICOM file of the source series, with or without pixels: patient, study and frame of
  // reference are taken from it.
  std::string source_header = {};
  std::string source_series_uid = {};
  std::vector<SourceImage> source_images = {};  // what the case was built from

  CaseFile contents = {};
  v1::Prediction prediction = {};
  Positions deformed = {};  // of the case's mesh, #V by 3
  // Of each vertex of the mesh the distance within which it stays in 95 of 100 cases if nothing
  // but the material is in doubt, mm; empty: not known, and why in words.
  std::vector<double> band_mm = {};
  std::string why_no_band = {};
  std::vector<v1::Measure> measures = {};
  std::vector<std::string> pictures = {};  // PNG files of one size, frame by frame

  std::map<std::string, std::string> uids = {};  // PredictionUidKeys -> UID
  absl::Time made = {};                          // the objects' date and time
  std::string device_serial = {};                // of this bridge, not empty
};

// What is written, in order: "stl:skin" (predicted), "stl:skin-before", "stl:segment:HANDLE" of
// every handle with surfaces, "stl:bone" where there is fixed bone, "capture", "report".
std::vector<std::string> ObjectKeys(const CaseFile& contents);

// What needs a UID before anything is written: ObjectKeys, their series ("series:models",
// "series:capture", "series:report") and the group of the models ("group").
std::vector<std::string> PredictionUidKeys(const CaseFile& contents);

// "series:models" of "stl:skin".
std::string SeriesKeyOf(const std::string& object_key);

// InvalidArgument: a list over its limit; a missing or invalid UID; two alike; an invalid band,
// measure or text. The code that reads paths and surfaces checks those.
absl::Status CheckPredictionInput(const PredictionObjectsInput& input);

std::map<std::string, HandlePose> PosesOf(const v1::Prediction& prediction);

}  // namespace tissueform
