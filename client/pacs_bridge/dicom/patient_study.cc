// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/patient_study.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

namespace tissueform {
namespace {

const std::vector<DcmTagKey>& ModuleTags() {
  static const std::vector<DcmTagKey> tags = {
      DCM_SpecificCharacterSet, DCM_TimezoneOffsetFromUTC,
      // Patient
      DCM_PatientName, DCM_PatientID, DCM_IssuerOfPatientID, DCM_TypeOfPatientID,
      DCM_IssuerOfPatientIDQualifiersSequence, DCM_SourcePatientGroupIdentificationSequence,
      DCM_GroupOfPatientsIdentificationSequence, DCM_PatientBirthDate, DCM_PatientBirthTime,
      DCM_PatientBirthDateInAlternativeCalendar, DCM_PatientDeathDateInAlternativeCalendar,
      DCM_PatientAlternativeCalendar, DCM_PatientSex, DCM_QualityControlSubject,
      DCM_ReferencedPatientPhotoSequence, DCM_ReferencedPatientSequence,
      DCM_RETIRED_OtherPatientIDs, DCM_OtherPatientIDsSequence, DCM_OtherPatientNames,
      DCM_EthnicGroup, DCM_PatientComments, DCM_PatientSpeciesDescription,
      DCM_PatientSpeciesCodeSequence, DCM_PatientBreedDescription, DCM_PatientBreedCodeSequence,
      DCM_BreedRegistrationSequence, DCM_StrainDescription, DCM_ResponsiblePerson,
      DCM_ResponsiblePersonRole, DCM_ResponsibleOrganization, DCM_PatientIdentityRemoved,
      DCM_DeidentificationMethod, DCM_DeidentificationMethodCodeSequence,
      // General Study
      DCM_StudyInstanceUID, DCM_StudyDate, DCM_StudyTime, DCM_ReferringPhysicianName,
      DCM_ReferringPhysicianIdentificationSequence, DCM_ConsultingPhysicianName,
      DCM_ConsultingPhysicianIdentificationSequence, DCM_StudyID, DCM_AccessionNumber,
      DCM_IssuerOfAccessionNumberSequence, DCM_StudyDescription, DCM_PhysiciansOfRecord,
      DCM_PhysiciansOfRecordIdentificationSequence, DCM_NameOfPhysiciansReadingStudy,
      DCM_PhysiciansReadingStudyIdentificationSequence, DCM_RequestingServiceCodeSequence,
      DCM_ReferencedStudySequence, DCM_ProcedureCodeSequence,
      DCM_ReasonForPerformedProcedureCodeSequence,
      // Patient Study
      DCM_AdmittingDiagnosesDescription, DCM_AdmittingDiagnosesCodeSequence, DCM_PatientAge,
      DCM_PatientSize, DCM_PatientWeight, DCM_MedicalAlerts, DCM_Allergies, DCM_SmokingStatus,
      DCM_PregnancyStatus, DCM_LastMenstrualDate, DCM_PatientState, DCM_Occupation,
      DCM_AdditionalPatientHistory, DCM_AdmissionID, DCM_IssuerOfAdmissionIDSequence,
      DCM_ServiceEpisodeID, DCM_ServiceEpisodeDescription, DCM_PatientSexNeutered};
  return tags;
}

}  // namespace

absl::Status CopyPatientAndStudy(DcmItem* from, DcmItem* to) {
  for (const DcmTagKey& tag : ModuleTags()) {
    delete to->remove(tag);
    DcmElement* element = nullptr;
    if (from->findAndGetElement(tag, element, OFFalse, OFTrue).bad()) continue;  // a copy of ours
    if (to->insert(element, OFTrue).bad()) {
      delete element;
      return absl::InternalError(
          absl::StrCat("the attribute ", tag.toString().c_str(), " cannot be copied"));
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
