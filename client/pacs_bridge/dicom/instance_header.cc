// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/instance_header.h"

#include <cmath>
#include <memory>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/dicom/dicom_text.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Decimal and integer strings and binary numbers alike.
std::optional<double> NumberOf(DcmItem* dataset, const DcmTagKey& tag, unsigned long at = 0) {
  constexpr Uint32 kMaxNumberBytes = 1024;
  DcmElement* element = nullptr;
  if (dataset->findAndGetElement(tag, element).bad()) return {};
  OFString text;
  if (element->getLength() > kMaxNumberBytes || element->getOFString(text, at).bad()) return {};
  double number = 0;
  if (!absl::SimpleAtod(text.c_str(), &number) || !std::isfinite(number)) return {};
  return number;
}

template <int kCount>
std::optional<Eigen::Vector<double, kCount>> NumbersOf(DcmItem* dataset, const DcmTagKey& tag) {
  Eigen::Vector<double, kCount> numbers;
  for (int i = 0; i < kCount; ++i) {
    const std::optional<double> number = NumberOf(dataset, tag, static_cast<unsigned long>(i));
    if (!number) return {};
    numbers[i] = *number;
  }
  return numbers;
}

std::optional<int> CountOf(DcmItem* dataset, const DcmTagKey& tag) {
  const std::optional<double> number = NumberOf(dataset, tag);
  if (!number || std::abs(*number) >= 1e9) return {};
  return static_cast<int>(*number);
}

struct TextField {
  DcmTagKey tag;
  std::string InstanceHeader::*field;
};

void ReadTexts(DcmItem* dataset, InstanceHeader* header) {
  static const TextField kTexts[] = {
      {DCM_PatientID, &InstanceHeader::patient_id},
      {DCM_IssuerOfPatientID, &InstanceHeader::issuer_of_patient_id},
      {DCM_PatientName, &InstanceHeader::patient_name},
      {DCM_PatientBirthDate, &InstanceHeader::birth_date},
      {DCM_PatientSex, &InstanceHeader::patient_sex},
      {DCM_StudyID, &InstanceHeader::study_id},
      {DCM_AccessionNumber, &InstanceHeader::accession_number},
      {DCM_StudyDate, &InstanceHeader::study_date},
      {DCM_StudyTime, &InstanceHeader::study_time},
      {DCM_StudyDescription, &InstanceHeader::study_description},
      {DCM_Modality, &InstanceHeader::modality},
      {DCM_SeriesDescription, &InstanceHeader::series_description},
      {DCM_ProtocolName, &InstanceHeader::protocol_name},
      {DCM_BodyPartExamined, &InstanceHeader::body_part},
      {DCM_SeriesDate, &InstanceHeader::series_date},
      {DCM_SeriesTime, &InstanceHeader::series_time},
      {DCM_Manufacturer, &InstanceHeader::manufacturer},
      {DCM_ConvolutionKernel, &InstanceHeader::convolution_kernel},
      {DCM_ImageType, &InstanceHeader::image_type},
      {DCM_ContrastBolusAgent, &InstanceHeader::contrast},
      {DCM_RescaleType, &InstanceHeader::rescale_type},
  };
  DicomTexts texts(dataset);
  for (const TextField& text : kTexts) header->*text.field = texts.Get(text.tag);
  header->text_problem = texts.problem();
}

void ReadGeometry(DcmItem* dataset, InstanceHeader* header) {
  header->series_number = CountOf(dataset, DCM_SeriesNumber);
  header->acquisition_number = CountOf(dataset, DCM_AcquisitionNumber);
  header->instance_number = CountOf(dataset, DCM_InstanceNumber);
  header->rows = CountOf(dataset, DCM_Rows).value_or(0);
  header->columns = CountOf(dataset, DCM_Columns).value_or(0);
  header->position_mm = NumbersOf<3>(dataset, DCM_ImagePositionPatient);
  if (const auto six = NumbersOf<6>(dataset, DCM_ImageOrientationPatient)) {
    header->axes.emplace();
    *header->axes << six->head<3>(), six->tail<3>();
  }
  header->pixel_spacing_mm = NumbersOf<2>(dataset, DCM_PixelSpacing);
  header->slice_thickness_mm = NumberOf(dataset, DCM_SliceThickness);
  header->slice_spacing_mm = NumberOf(dataset, DCM_SpacingBetweenSlices);
  header->gantry_tilt_deg = NumberOf(dataset, DCM_GantryDetectorTilt);
  header->rescale_slope = NumberOf(dataset, DCM_RescaleSlope);
  header->rescale_intercept = NumberOf(dataset, DCM_RescaleIntercept);
}

struct UidField {
  DcmTagKey tag;
  std::string InstanceHeader::*field;
  bool wanted;
};

absl::Status ReadUids(const std::string& path, DcmItem* dataset, InstanceHeader* header) {
  static const UidField kUids[] = {
      {DCM_SOPClassUID, &InstanceHeader::class_uid, true},
      {DCM_SOPInstanceUID, &InstanceHeader::instance_uid, true},
      {DCM_StudyInstanceUID, &InstanceHeader::study_uid, true},
      {DCM_SeriesInstanceUID, &InstanceHeader::series_uid, true},
      {DCM_FrameOfReferenceUID, &InstanceHeader::frame_uid, false},
  };
  DicomTexts texts(dataset);
  for (const UidField& uid : kUids) {
    std::string text = texts.Get(uid.tag);
    if ((uid.wanted || !text.empty()) && !IsDicomUid(text)) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": the attribute ",
                                                     uid.tag.toString().c_str(), " is ",
                                                     text.empty() ? "missing" : "no UID"));
    }
    header->*uid.field = std::move(text);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<InstanceHeader> ReadInstanceHeader(const std::string& path,
                                                  const DicomLimits& limits) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<DcmFileFormat> file, LoadDicomHeader(path, limits));
  InstanceHeader header;
  TF_RETURN_IF_ERROR(ReadUids(path, file->getDataset(), &header));
  header.transfer_syntax_uid = DcmXfer(file->getDataset()->getOriginalXfer()).getXferID();
  ReadTexts(file->getDataset(), &header);
  ReadGeometry(file->getDataset(), &header);
  return header;
}

}  // namespace tissueform
