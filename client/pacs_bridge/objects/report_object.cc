// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/report_object.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/objects/report_tree.h"
#include "client/pacs_bridge/objects/skin_movement.h"
#include "core/base/software_version.h"

namespace tissueform {
namespace {

// Of the program as an observer, made once for all.
constexpr char kDeviceUid[] = "2.25.197327460839218345127709846123045587331";
constexpr size_t kMaxText = 256;

const CodedTerm& Mean() {
  static const CodedTerm term = {"373098007", "SCT", "Mean"};
  return term;
}
const CodedTerm& Largest() {
  static const CodedTerm term = {"56851009", "SCT", "Maximum"};
  return term;
}

CodedTerm NameTerm() { return OwnTerm("NAME", "Name"); }

void AddPlain(const CodedTerm& name, const std::string& text, ReportTree* tree) {
  if (!text.empty()) tree->AddText(name, PlainDicomText(text, kMaxText));
}

// "neo_hookean", as plans have it.
std::string ModelWord(v1::DeformationModel model) {
  const std::string& name = v1::DeformationModel_Name(model);
  return absl::AsciiStrToLower(absl::StripPrefix(name, "DEFORMATION_MODEL_"));
}

void AddOrigin(const PredictionObjectsInput& input, ReportTree* tree) {
  const v1::Prediction& prediction = input.prediction;
  tree->Open(OwnTerm("ORIGIN", "Origin of the prediction"));
  AddPlain(OwnTerm("MODEL", "Model"), ModelWord(prediction.model()), tree);
  AddPlain(OwnTerm("SERVER", "Version of the server"),
           absl::StrCat(prediction.software_version(), " ", prediction.software_commit()), tree);
  AddPlain(OwnTerm("BRIDGE", "Version of the bridge"),
           absl::StrCat(SoftwareVersion(), " ", SoftwareCommit()), tree);
  AddPlain(OwnTerm("PLANNED_BY", "Software that made the case"),
           absl::StrCat(input.contents.software, " ", input.contents.commit), tree);
  AddPlain(OwnTerm("PREDICTION", "Prediction"), prediction.name(), tree);
  AddPlain(OwnTerm("CASE", "Case"), prediction.case_(), tree);
  AddPlain(OwnTerm("MESH_SHA256", "SHA-256 of the mesh"),
           std::string(absl::StripPrefix(prediction.mesh(), "meshes/")), tree);
  AddPlain(OwnTerm("PLAN_SHA256", "SHA-256 of the plan"), input.contents.plan_sha256, tree);
  AddPlain(OwnTerm("RECIPE_SHA256", "SHA-256 of assigning stiffness and regions"),
           prediction.recipe_sha256(), tree);
  tree->Close();
}

void AddMovement(const Eigen::Vector3d& movement, const HeadFrame& frame, ReportTree* tree) {
  const HeadMovement parts = InHeadFrame(movement, frame);
  tree->AddNumber(OwnTerm("MOVEMENT", "Movement"), movement.norm(), "mm");
  tree->AddNumber(OwnTerm("LEFT", "Movement to the patient's left"), parts.left_mm, "mm");
  tree->AddNumber(OwnTerm("FORWARD", "Movement forward"), parts.forward_mm, "mm");
  tree->AddNumber(OwnTerm("UP", "Movement up"), parts.up_mm, "mm");
}

// As a planner shows it: of the pivot, and about it, in the head frame.
void AddSegment(const CaseHandle& handle, const HandlePose& pose, const HeadFrame& frame,
                ReportTree* tree) {
  const HeadAngles angles = AnglesFromRotationVector(pose.rotation_vector, frame);
  tree->Open(OwnTerm("SEGMENT", "Bone segment"));
  AddPlain(NameTerm(), handle.name, tree);
  AddMovement(ApplyPose(pose, handle.pivot_mm) - handle.pivot_mm, frame, tree);
  tree->AddNumber(OwnTerm("PITCH", "Pitch, chin up positive"), angles.pitch_deg, "deg");
  tree->AddNumber(OwnTerm("ROLL", "Roll, patient's left down positive"), angles.roll_deg, "deg");
  tree->AddNumber(OwnTerm("YAW", "Yaw, chin to the patient's left positive"), angles.yaw_deg,
                  "deg");
  tree->Close();
}

void AddSegments(const PredictionObjectsInput& input, ReportTree* tree) {
  tree->Open(OwnTerm("SEGMENTS", "Planned movement of bone"));
  const auto poses = PosesOf(input.prediction);
  for (const CaseHandle& handle : input.contents.handles) {
    const auto pose = poses.find(handle.name);
    if (pose != poses.end()) {
      AddSegment(handle, pose->second, input.contents.head_frame, tree);
    }
  }
  tree->Close();
}

void AddPlaces(const PredictionObjectsInput& input, const PredictedCase& predicted,
               ReportTree* tree) {
  const std::vector<PlaceMovement> places = MovementOfPlaces(input, predicted);
  if (places.empty()) return;
  const CodedTerm movement = OwnTerm("MOVEMENT", "Movement");
  tree->Open(OwnTerm("SKIN", "Predicted movement of the skin"));
  if (input.band_mm.empty()) {
    AddPlain(OwnTerm("NO_BAND", "Why no band of uncertainty is known"), input.why_no_band, tree);
  }
  for (const PlaceMovement& place : places) {
    tree->Open(OwnTerm("PLACE", "Place of the face"));
    AddPlain(NameTerm(), place.name, tree);
    tree->AddNumber(movement, place.mean_mm, "mm", Mean());
    tree->AddNumber(movement, place.p95_mm, "mm", OwnTerm("P95", "95th percentile"));
    tree->AddNumber(movement, place.largest_mm, "mm", Largest());
    if (place.largest_band_mm) {
      tree->AddNumber(OwnTerm("BAND", "Band of uncertainty of the material, 95 of 100 cases"),
                      *place.largest_band_mm, "mm", Largest());
    }
    tree->Close();
  }
  tree->Close();
}

void AddLandmarks(const PredictionObjectsInput& input, const PredictedCase& predicted,
                  ReportTree* tree) {
  if (input.contents.landmarks.empty()) return;
  tree->Open(OwnTerm("LANDMARKS", "Movement of landmarks"));
  for (size_t l = 0; l < input.contents.landmarks.size(); ++l) {
    const CaseLandmark& landmark = input.contents.landmarks[l];
    tree->Open(OwnTerm("LANDMARK", "Landmark"));
    AddPlain(NameTerm(), landmark.name, tree);
    AddMovement(predicted.landmarks_mm[l] - landmark.position_mm, input.contents.head_frame, tree);
    tree->Close();
  }
  tree->Close();
}

// The interval of the material alone is far narrower: both names say what is in doubt.
CodedTerm LowestAfter(bool is_whole) {
  return is_whole
             ? OwnTerm("WHOLE_LOWEST", "After, lowest in 95 of 100 cases: surgery, model, material")
             : OwnTerm("AFTER_LOWEST", "After, lowest in 95 of 100 cases, of the material");
}

CodedTerm HighestAfter(bool is_whole) {
  return is_whole ? OwnTerm("WHOLE_HIGHEST",
                            "After, highest in 95 of 100 cases: surgery, model, material")
                  : OwnTerm("AFTER_HIGHEST", "After, highest in 95 of 100 cases, of the material");
}

void AddMeasure(const v1::Measure& measure, ReportTree* tree) {
  tree->Open(OwnTerm("MEASURE", "Measure"));
  AddPlain(NameTerm(), measure.name(), tree);
  AddPlain(OwnTerm("TITLE", "Title"), measure.title(), tree);
  tree->AddNumber(OwnTerm("BEFORE", "Before"), measure.before(), measure.unit());
  tree->AddNumber(OwnTerm("AFTER", "After, predicted"), measure.after(), measure.unit());
  tree->AddNumber(OwnTerm("DIFFERENCE", "Difference, after minus before"),
                  measure.after() - measure.before(), measure.unit());
  if (measure.has_lowest_after() && measure.has_highest_after()) {
    const bool is_whole = measure.interval_is_whole();
    tree->AddNumber(LowestAfter(is_whole), measure.lowest_after(), measure.unit());
    tree->AddNumber(HighestAfter(is_whole), measure.highest_after(), measure.unit());
  }
  tree->Close();
}

void AddMeasures(const PredictionObjectsInput& input, ReportTree* tree) {
  if (input.measures.empty()) return;
  tree->Open(OwnTerm("MEASURES", "Measures of the face"));
  for (const v1::Measure& measure : input.measures) AddMeasure(measure, tree);
  tree->Close();
}

void AddWritten(const PredictionObjectsInput& input, const std::string& study_uid,
                ReportTree* tree) {
  tree->Open(OwnTerm("OBJECTS", "Objects of this prediction"));
  for (const std::string& key : ObjectKeys(input.contents)) {
    if (key == "report") continue;
    const bool is_model = absl::StartsWith(key, "stl:");
    const std::string class_uid(is_model ? kEncapsulatedStlClass : kColourCaptureClass);
    const std::string& instance_uid = input.uids.at(key);
    if (is_model) {
      tree->AddReference(OwnTerm("SURFACE", "Surface"), class_uid, instance_uid);
    } else {
      tree->AddImage(OwnTerm("CAPTURE", "Pictures"), class_uid, instance_uid);
    }
    tree->AddEvidence(study_uid, input.uids.at(SeriesKeyOf(key)), class_uid, instance_uid);
  }
  for (const SourceImage& image : input.source_images) {
    tree->AddOtherEvidence(study_uid, input.source_series_uid, image.class_uid, image.instance_uid);
  }
  tree->Close();
}

}  // namespace

absl::Status WriteReportModules(const PredictionObjectsInput& input, const PredictedCase& predicted,
                                const std::string& study_uid, DcmDataset* object) {
  ReportTree tree({"126000", "DCM", "Imaging Measurement Report"});
  tree.AddContext("Tissueform", kDeviceUid);
  tree.AddText({"121106", "DCM", "Comment"}, kResearchNotice);
  AddOrigin(input, &tree);
  AddSegments(input, &tree);
  AddPlaces(input, predicted, &tree);
  AddLandmarks(input, predicted, &tree);
  AddMeasures(input, &tree);
  AddWritten(input, study_uid, &tree);
  return tree.Write(object);
}

}  // namespace tissueform
