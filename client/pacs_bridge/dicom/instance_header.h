// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "core/imaging/series/image_header.h"

namespace tissueform {

// What the bridge wants to know of one object: what a series is chosen by, and whose it is. Texts
// are UTF-8 and have at most DicomTexts::kMaxBytes. The UIDs are as IsDicomUid wants them, or
// empty.
struct InstanceHeader : ImageHeader {
  std::string instance_uid = {};
  std::string transfer_syntax_uid = {};

  // The patient's: for the review page and to see whether it changed; never for a log or a name.
  std::string patient_id = {};
  std::string issuer_of_patient_id = {};
  std::string patient_name = {};  // groups of components with "=" between
  std::string birth_date = {};    // YYYYMMDD
  std::string patient_sex = {};

  std::string study_id = {};
  std::string accession_number = {};
  std::string study_date = {};
  std::string study_time = {};
  std::string study_description = {};

  std::string protocol_name = {};
  std::string body_part = {};
  std::string series_date = {};
  std::string series_time = {};
  std::string manufacturer = {};

  std::optional<double> slice_spacing_mm = {};  // SpacingBetweenSlices
  std::optional<double> gantry_tilt_deg = {};

  // What was wrong with a text, in one line without values of the patient ("the attribute
  // (0010,0010) is longer than 1024 bytes and is cut"); empty: nothing.
  std::string text_problem = {};
};

// Reads the header of a DICOM file, nothing of its pixels. Any thread; about a millisecond.
//
// Errors: those of LoadDicomHeader; InvalidArgument when a UID is no UID, or class, instance, study
// or series have none.
absl::StatusOr<InstanceHeader> ReadInstanceHeader(const std::string& path,
                                                  const DicomLimits& limits = {});

}  // namespace tissueform
