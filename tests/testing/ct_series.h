// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

// Small CT series as a scanner would send them, made of nothing: for tests of the PACS bridge.
namespace tissueform::testing {

struct CtSeriesOptions {
  // The patient; "\n" in none of them. Bytes are written as they are, for any character set.
  std::string patient_name = "Planted^Patricia^Q";
  std::string patient_id = "PLANTED-4711";
  std::string issuer_of_patient_id = "Planted Hospital";
  std::string birth_date = "19610203";
  std::string sex = "F";
  std::string character_set = {};  // SpecificCharacterSet; empty: none

  // Empty UIDs: new ones.
  std::string study_uid = {};
  std::string series_uid = {};
  std::string frame_uid = {};
  std::string study_id = "S1";
  std::string accession_number = "A4711";
  std::string study_date = "20260102";
  std::string study_description = "Head";

  std::string modality = "CT";
  std::string class_uid = {};  // SOP class; empty: CT Image
  std::string series_description = "Bone 1.0";
  std::string kernel = "H60s";
  std::string image_type = "ORIGINAL\\PRIMARY\\AXIAL";
  std::string contrast = {};
  int series_number = 2;

  int slices = 8;
  int rows = 48;
  int columns = 64;
  double pixel_spacing_mm = 2;
  double slice_spacing_mm = 3;
  // Columns: along a row, along a column, from slice to slice (LPS, unit length). Not square to
  // the slices: a tilted gantry.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Eigen::Vector3d origin_mm = {-60, -40, 10};  // of the first pixel of the first slice

  // One voxel of 3,000 HU: column, row, slice; negative: none.
  Eigen::Vector3i marker = {-1, -1, -1};
  std::string private_text = {};  // of (0029,1010), 64 KiB or so; empty: none
};

struct CtSeries {
  std::string study_uid = {};
  std::string series_uid = {};
  std::string frame_uid = {};
  std::vector<std::string> instance_uids = {};  // from slice to slice, as the files
  std::vector<std::string> files = {};
  Eigen::Vector3d marker_mm = Eigen::Vector3d::Zero();  // where the marker lies
};

// Writes slice NNNN.dcm by slice into a folder that is there: a ball of bone (1,000 HU) in a ball
// of soft tissue (40 HU) in air, explicit little endian. Ends the program on errors.
CtSeries WriteCtSeries(const std::filesystem::path& folder, const CtSeriesOptions& options = {});

}  // namespace tissueform::testing
