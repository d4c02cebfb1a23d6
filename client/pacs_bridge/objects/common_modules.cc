// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/common_modules.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/dicom/patient_study.h"
#include "client/pacs_bridge/objects/dicom_items.h"
#include "core/base/software_version.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Of a value with a length of 16 bits, which is even.
constexpr Uint32 kMaxShortBytes = 65'534;
constexpr size_t kMaxLongString = 64;

std::string ValueOf(DcmItem* item, const DcmTagKey& tag) {
  OFString value;
  if (item->findAndGetOFString(tag, value).bad()) return "";
  return value.c_str();
}

// "+0130" of the study; the machine's where it says nothing.
absl::TimeZone ZoneOf(DcmItem* source) {
  const std::string text = ValueOf(source, DCM_TimezoneOffsetFromUTC);
  int number = 0;
  if (text.size() < 5 || !absl::SimpleAtoi(absl::string_view(text).substr(0, 5), &number)) {
    return absl::LocalTimeZone();
  }
  return absl::FixedTimeZone((number / 100 * 60 + number % 100) * 60);
}

absl::Status CheckTextLengths(DcmItem* item) {
  DcmStack stack;
  while (item->nextObject(stack, OFTrue).good()) {
    DcmObject* object = stack.top();
    const DcmVR vr(object->getVR());
    if (object->isLeaf() && !vr.usesExtendedLengthEncoding() &&
        object->getLength() > kMaxShortBytes) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the attribute ", object->getTag().toString().c_str(), " of the source has ",
          object->getLength(), " bytes, which no object can hold; correct it in the PACS"));
    }
  }
  return absl::OkStatus();
}

void WriteSeries(const PredictionObjectsInput& input, const ObjectIdentity& identity,
                 const DicomTimes& times, ItemWriter* writer) {
  writer->Text(DCM_Modality, identity.modality);
  writer->Text(DCM_SeriesInstanceUID, input.uids.at(SeriesKeyOf(identity.key)));
  writer->Text(DCM_SeriesNumber, absl::StrCat(identity.series_number));
  writer->Text(DCM_SeriesDate, times.date);
  writer->Text(DCM_SeriesTime, times.time);
  writer->Text(DCM_SeriesDescription,
               absl::StrCat(identity.description, ". ", kResearchNotice).substr(0, kMaxLongString));
  writer->Text(DCM_SOPClassUID, std::string(identity.class_uid));
  writer->Text(DCM_SOPInstanceUID, input.uids.at(identity.key));
  writer->Text(DCM_InstanceNumber, absl::StrCat(identity.instance_number));
  writer->Text(DCM_InstanceCreationDate, times.date);
  writer->Text(DCM_InstanceCreationTime, times.time);
  writer->Text(DCM_ContentDate, times.date);
  writer->Text(DCM_ContentTime, times.time);
}

void WriteEquipment(const PredictionObjectsInput& input, ItemWriter* writer) {
  writer->Text(DCM_Manufacturer, "The Tissueform Authors");
  writer->Text(DCM_ManufacturerModelName, "Tissueform");
  writer->Text(DCM_DeviceSerialNumber, PlainDicomText(input.device_serial, kMaxLongString));
  const std::string server =
      PlainDicomText(absl::StrCat("tissueform-server ", input.prediction.software_version(), " ",
                                  input.prediction.software_commit()),
                     kMaxLongString);
  const std::string bridge = PlainDicomText(
      absl::StrCat("tissueform-pacs ", SoftwareVersion(), " ", SoftwareCommit()), kMaxLongString);
  writer->Text(DCM_SoftwareVersions, absl::StrCat(server, "\\", bridge));
}

void WriteReference(const SourceImage& image, ItemWriter* item) {
  item->Text(DCM_ReferencedSOPClassUID, image.class_uid);
  item->Text(DCM_ReferencedSOPInstanceUID, image.instance_uid);
}

// By series, as the module Common Instance Reference wants them.
void WriteReferencedSeries(const PredictionObjectsInput& input, ItemWriter* writer) {
  ItemWriter series = writer->NewItem(DCM_ReferencedSeriesSequence);
  series.Text(DCM_SeriesInstanceUID, input.source_series_uid);
  for (const SourceImage& image : input.source_images) {
    ItemWriter item = series.NewItem(DCM_ReferencedInstanceSequence);
    WriteReference(image, &item);
    series.Take(item);
  }
  writer->Take(series);
}

// What an object must have, though a scanner may have left it out.
void WriteMissingEmpty(DcmItem* object, ItemWriter* writer) {
  for (const DcmTagKey& tag :
       {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate,
        DCM_StudyTime, DCM_StudyID, DCM_AccessionNumber, DCM_ReferringPhysicianName}) {
    if (!object->tagExists(tag)) writer->Text(tag, "");
  }
}

// Whose the terms of OwnTerm are.
void WriteCodingScheme(ItemWriter* writer) {
  ItemWriter scheme = writer->NewItem(DCM_CodingSchemeIdentificationSequence);
  scheme.Text(DCM_CodingSchemeDesignator, kOwnScheme);
  scheme.Text(DCM_CodingSchemeName, "Terms of Tissueform");
  scheme.Text(DCM_CodingSchemeResponsibleOrganization, "The Tissueform Authors");
  writer->Take(scheme);
}

}  // namespace

DicomTimes TimesOf(DcmDataset* source, absl::Time made) {
  const absl::TimeZone zone = ZoneOf(source);
  return {absl::FormatTime("%Y%m%d", made, zone), absl::FormatTime("%H%M%S", made, zone)};
}

absl::Status CheckSource(DcmDataset* source) {
  for (const DcmTagKey& tag : {DCM_StudyInstanceUID, DCM_FrameOfReferenceUID}) {
    if (!IsDicomUid(ValueOf(source, tag))) {
      return absl::InvalidArgumentError(absl::StrCat("the source has no usable ",
                                                     DcmTag(tag).getTagName(),
                                                     "; the prediction cannot refer to it"));
    }
  }
  DcmDataset copy;
  TF_RETURN_IF_ERROR(CopyPatientAndStudy(source, &copy));
  return CheckTextLengths(&copy);
}

absl::Status WriteCommonModules(DcmDataset* source, const PredictionObjectsInput& input,
                                const ObjectIdentity& identity, DcmDataset* object) {
  TF_RETURN_IF_ERROR(CopyPatientAndStudy(source, object));
  ItemWriter writer(object);
  WriteMissingEmpty(object, &writer);
  WriteSeries(input, identity, TimesOf(source, input.made), &writer);
  if (identity.in_frame) {
    writer.Text(DCM_FrameOfReferenceUID, ValueOf(source, DCM_FrameOfReferenceUID));
    writer.Text(DCM_PositionReferenceIndicator, ValueOf(source, DCM_PositionReferenceIndicator));
  }
  WriteEquipment(input, &writer);
  // A report names its evidence instead.
  if (identity.modality != "SR") WriteReferencedSeries(input, &writer);
  WriteCodingScheme(&writer);
  return writer.status();
}

absl::Status WriteSourceImages(const PredictionObjectsInput& input, DcmDataset* object) {
  ItemWriter writer(object);
  for (const SourceImage& image : input.source_images) {
    ItemWriter item = writer.NewItem(DCM_SourceImageSequence);
    WriteReference(image, &item);
    item.Code(DCM_PurposeOfReferenceCodeSequence,
              {"121322", "DCM", "Source image for image processing operation"});
    writer.Take(item);
  }
  return writer.status();
}

}  // namespace tissueform
