// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "client/pacs_bridge/dicom/dicom_file.h"

namespace tissueform {

// What the bridge wants to know of one object. Texts are UTF-8, trimmed, at most
// DicomTexts::kMaxBytes; empty where the object says nothing. Several values have "\\" between.
struct InstanceHeader {
  std::string study_uid = {};  // UIDs: as IsDicomUid wants them, or empty
  std::string series_uid = {};
  std::string instance_uid = {};
  std::string class_uid = {};
  std::string transfer_syntax_uid = {};
  std::string frame_uid = {};  // of reference

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

  std::string modality = {};
  std::string series_description = {};
  std::string protocol_name = {};
  std::string body_part = {};
  std::string series_date = {};
  std::string series_time = {};
  std::string manufacturer = {};
  std::string convolution_kernel = {};
  std::string image_type = {};  // "ORIGINAL\\PRIMARY\\AXIAL"
  std::string contrast = {};    // the agent
  int series_number = 0;
  int acquisition_number = 0;
  int instance_number = 0;

  int rows = 0;
  int columns = 0;
  int frames = 1;
  std::optional<Eigen::Vector3d> position = {};          // mm, LPS: centre of the first pixel
  std::optional<Eigen::Matrix<double, 3, 2>> axes = {};  // along a row, along a column
  std::optional<Eigen::Vector2d> pixel_spacing_mm = {};  // between rows, between columns
  std::optional<double> slice_thickness_mm = {};
  std::optional<double> slice_spacing_mm = {};  // SpacingBetweenSlices
  std::optional<double> gantry_tilt_deg = {};
  std::optional<double> rescale_slope = {};  // to Hounsfield units; without these there are none
  std::optional<double> rescale_intercept = {};
  std::string rescale_type = {};

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
