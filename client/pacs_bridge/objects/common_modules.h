// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/objects/prediction_input.h"

class DcmDataset;

namespace tissueform {

// What distinguishes one object from the others of a prediction.
struct ObjectIdentity {
  std::string key = {};  // of ObjectKeys
  absl::string_view class_uid = {};
  std::string modality = {};
  int series_number = 0;
  int instance_number = 1;
  std::string description = {};  // of the series; the notice is added
  bool in_frame = false;         // has places in the source's frame of reference
};

// Whether patient and study of the source can be put into another object.
//
// Errors: InvalidArgument: it has no study, no frame of reference, or a text that no explicit
// transfer syntax can hold (over 65,534 bytes); with the tag, without the text.
absl::Status CheckSource(DcmDataset* source);

// Patient and study as the source has them, the series, the equipment, SOP common, which images it
// was made from, and for models the frame of reference. What `object` had of them is replaced.
//
// REQUIRES: CheckSource and CheckPredictionInput are OK. Errors: Internal, with the tag.
absl::Status WriteCommonModules(DcmDataset* source, const PredictionObjectsInput& input,
                                const ObjectIdentity& identity, DcmDataset* object);

// The same images with what they were to the object (SourceImageSequence); only images take it.
absl::Status WriteSourceImages(const PredictionObjectsInput& input, DcmDataset* object);

// "20260102" and "101112" of the objects, in the zone of the study's times: the one that it says,
// else the machine's.
struct DicomTimes {
  std::string date;
  std::string time;
};
DicomTimes TimesOf(DcmDataset* source, absl::Time made);

}  // namespace tissueform
