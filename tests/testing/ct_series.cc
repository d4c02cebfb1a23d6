// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/ct_series.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/imaging/series/image_header.h"

namespace tissueform::testing {
namespace {

void Require(bool good, absl::string_view what) {
  if (good) return;
  std::fprintf(stderr, "ct_series: %s\n", std::string(what).c_str());
  std::abort();
}

void Put(DcmItem* item, const DcmTagKey& tag, const std::string& value) {
  Require(item->putAndInsertString(tag, value.c_str()).good(), tag.toString().c_str());
}

void PutNumbers(DcmItem* item, const DcmTagKey& tag, const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) {
    // Sixteen characters at most, the standard's limit of a decimal string.
    std::string digits = absl::StrFormat("%.12f", number).substr(0, 16);
    absl::StrAppend(&text, text.empty() ? "" : "\\", digits);
  }
  Put(item, tag, text);
}

// The centre of a voxel.
Eigen::Vector3d PlaceOf(const CtSeriesOptions& options, const Eigen::Vector3d& voxel) {
  const Eigen::Vector3d steps(options.pixel_spacing_mm, options.pixel_spacing_mm,
                              options.slice_spacing_mm);
  return options.origin_mm + options.axes * voxel.cwiseProduct(steps);
}

int16_t Hounsfield(const CtSeriesOptions& options, const Eigen::Vector3i& voxel) {
  if (voxel == options.marker) return 3000;
  const Eigen::Vector3d size(options.columns, options.rows, options.slices);
  const Eigen::Vector3d middle = PlaceOf(options, (size - Eigen::Vector3d::Ones()) / 2);
  const double radius_mm = 0.4 * options.pixel_spacing_mm * std::min(options.rows, options.columns);
  const double distance_mm = (PlaceOf(options, voxel.cast<double>()) - middle).norm();
  if (distance_mm < radius_mm / 2) return 1000;
  return distance_mm < radius_mm ? 40 : -1000;
}

void PutPatientAndStudy(const CtSeriesOptions& options, const CtSeries& series, DcmDataset* slice) {
  if (!options.character_set.empty()) Put(slice, DCM_SpecificCharacterSet, options.character_set);
  Put(slice, DCM_PatientName, options.patient_name);
  Put(slice, DCM_PatientID, options.patient_id);
  Put(slice, DCM_IssuerOfPatientID, options.issuer_of_patient_id);
  Put(slice, DCM_PatientBirthDate, options.birth_date);
  Put(slice, DCM_PatientSex, options.sex);
  Put(slice, DCM_StudyInstanceUID, series.study_uid);
  Put(slice, DCM_StudyID, options.study_id);
  Put(slice, DCM_AccessionNumber, options.accession_number);
  Put(slice, DCM_StudyDate, options.study_date);
  Put(slice, DCM_StudyTime, "101112");
  Put(slice, DCM_ReferringPhysicianName, "Planted^Referrer");
  Put(slice, DCM_StudyDescription, options.study_description);
}

void PutSeries(const CtSeriesOptions& options, const CtSeries& series, DcmDataset* slice) {
  Put(slice, DCM_Modality, options.modality);
  Put(slice, DCM_SeriesInstanceUID, series.series_uid);
  Put(slice, DCM_SeriesNumber, absl::StrCat(options.series_number));
  Put(slice, DCM_SeriesDescription, options.series_description);
  Put(slice, DCM_Manufacturer, "Nobody");
  Put(slice, DCM_ConvolutionKernel, options.kernel);
  Put(slice, DCM_KVP, "120");
  if (!options.contrast.empty()) Put(slice, DCM_ContrastBolusAgent, options.contrast);
  Put(slice, DCM_FrameOfReferenceUID, series.frame_uid);
  Put(slice, DCM_PositionReferenceIndicator, "");
  Put(slice, DCM_ImageType, options.image_type);
  if (options.private_text.empty()) return;
  Put(slice, DcmTag(0x0029, 0x0010, EVR_LO), "PLANTED PRIVATE");
  Require(slice->putAndInsertString(DcmTag(0x0029, 0x1010, EVR_UT), options.private_text.c_str())
              .good(),
          "the private text");
}

void PutImage(const CtSeriesOptions& options, int index, DcmDataset* slice) {
  const Eigen::Vector3d place = PlaceOf(options, Eigen::Vector3d(0, 0, index));
  const auto& axes = options.axes;
  PutNumbers(slice, DCM_ImagePositionPatient, {place.x(), place.y(), place.z()});
  PutNumbers(slice, DCM_ImageOrientationPatient,
             {axes(0, 0), axes(1, 0), axes(2, 0), axes(0, 1), axes(1, 1), axes(2, 1)});
  PutNumbers(slice, DCM_PixelSpacing, {options.pixel_spacing_mm, options.pixel_spacing_mm});
  PutNumbers(slice, DCM_SliceThickness, {options.slice_spacing_mm});
  Put(slice, DCM_InstanceNumber, absl::StrCat(index + 1));
  Put(slice, DCM_AcquisitionNumber, "1");
  Put(slice, DCM_PhotometricInterpretation, "MONOCHROME2");
  slice->putAndInsertUint16(DCM_SamplesPerPixel, 1);
  slice->putAndInsertUint16(DCM_Rows, static_cast<Uint16>(options.rows));
  slice->putAndInsertUint16(DCM_Columns, static_cast<Uint16>(options.columns));
  slice->putAndInsertUint16(DCM_BitsAllocated, 16);
  slice->putAndInsertUint16(DCM_BitsStored, 16);
  slice->putAndInsertUint16(DCM_HighBit, 15);
  slice->putAndInsertUint16(DCM_PixelRepresentation, 1);
  Put(slice, DCM_RescaleIntercept, "-1024");
  Put(slice, DCM_RescaleSlope, "1");
  Put(slice, DCM_RescaleType, "HU");
  std::vector<Uint16> pixels;
  for (int row = 0; row < options.rows; ++row) {
    for (int column = 0; column < options.columns; ++column) {
      pixels.push_back(static_cast<Uint16>(Hounsfield(options, {column, row, index}) + 1024));
    }
  }
  Require(slice->putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size()).good(),
          "the pixels");
}

std::string UidOr(const std::string& given) { return given.empty() ? NewDicomUid() : given; }

}  // namespace

CtSeries WriteCtSeries(const std::filesystem::path& folder, const CtSeriesOptions& options) {
  Require(PrepareDcmtk().ok(), "DCMTK's dictionary is not there");
  CtSeries series;
  series.study_uid = UidOr(options.study_uid);
  series.series_uid = UidOr(options.series_uid);
  series.frame_uid = UidOr(options.frame_uid);
  series.marker_mm = PlaceOf(options, options.marker.cast<double>());
  for (int i = 0; i < options.slices; ++i) {
    DcmFileFormat file;
    DcmDataset* slice = file.getDataset();
    series.instance_uids.push_back(NewDicomUid());
    Put(slice, DCM_SOPClassUID,
        options.class_uid.empty() ? std::string(kCtImageClass) : options.class_uid);
    Put(slice, DCM_SOPInstanceUID, series.instance_uids.back());
    PutPatientAndStudy(options, series, slice);
    PutSeries(options, series, slice);
    PutImage(options, i, slice);
    series.files.push_back((folder / absl::StrFormat("%04d.dcm", i)).string());
    Require(file.saveFile(series.files.back().c_str(), EXS_LittleEndianExplicit).good(),
            "a file cannot be written");
  }
  return series;
}

}  // namespace tissueform::testing
