// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/prediction_objects.h"

#include <functional>
#include <memory>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/objects/capture_object.h"
#include "client/pacs_bridge/objects/common_modules.h"
#include "client/pacs_bridge/objects/report_object.h"
#include "client/pacs_bridge/objects/stl_object.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/predicted_case.h"

namespace tissueform {
namespace {

constexpr char kSegmentKey[] = "stl:segment:";

// Far beyond those of scanners, so that each kind has one of its own.
constexpr int kModelsSeries = 9101;
constexpr int kCaptureSeries = 9102;
constexpr int kReportSeries = 9103;

void AppendSurface(const FloatPositions& positions, const TriangleIndices& triangles,
                   ModelSurface* model) {
  const Eigen::Index vertices = model->positions.rows();
  const Eigen::Index count = model->triangles.rows();
  model->positions.conservativeResize(vertices + positions.rows(), 3);
  model->positions.bottomRows(positions.rows()) = positions;
  model->triangles.conservativeResize(count + triangles.rows(), 3);
  model->triangles.bottomRows(triangles.rows()) =
      triangles.array() + static_cast<int32_t>(vertices);
}

bool BelongsTo(const std::string& key, const CaseSurface& surface) {
  if (surface.kind == SurfaceKind::kSkin) return absl::StartsWith(key, "stl:skin");
  return surface.handle.empty() ? key == "stl:bone" : key == kSegmentKey + surface.handle;
}

// Which surfaces of the case they hold, and as what.
ModelSurface ModelOfKey(const std::string& key, const CaseFile& contents,
                        const PredictedCase& predicted) {
  const bool before = key == "stl:skin-before";
  ModelSurface model{.key = key};
  for (size_t s = 0; s < contents.surfaces.size(); ++s) {
    const CaseSurface& surface = contents.surfaces[s];
    if (!BelongsTo(key, surface)) continue;
    const FloatPositions& positions = before ? surface.positions : predicted.surfaces[s];
    model.modified = model.modified || positions != surface.positions;
    AppendSurface(positions, surface.triangles, &model);
  }
  if (key == "stl:skin") {
    model.kind = OwnTerm("SKIN_PREDICTED", "Skin, predicted");
  } else if (before) {
    model.kind = OwnTerm("SKIN_BEFORE", "Skin before");
  } else if (key == "stl:bone") {
    model.kind = OwnTerm("BONE_FIXED", "Bone that does not move");
  } else {
    model.kind = OwnTerm("BONE_SEGMENT", "Bone segment, planned");
  }
  model.title = model.kind.meaning;
  absl::string_view handle = key;
  if (absl::ConsumePrefix(&handle, kSegmentKey)) {
    model.title = absl::StrCat("Bone segment ", PlainDicomText(handle, 64), ", planned");
  }
  return model;
}

// The objects of one call.
class StudyFiles {
 public:
  StudyFiles(const PredictionObjectsInput& input, DcmDataset* source, std::string folder)
      : input_(input), source_(source), folder_(std::move(folder)) {}

  // `fill` writes what is the object's own, before the common modules.
  absl::Status Write(const ObjectIdentity& identity,
                     const std::function<absl::Status(DcmDataset*)>& fill) {
    DcmDataset object;
    TF_RETURN_IF_ERROR(fill(&object));
    TF_RETURN_IF_ERROR(WriteCommonModules(source_, input_, identity, &object));
    const std::string& uid = input_.uids.at(identity.key);
    std::string path = absl::StrCat(folder_, "/", uid, ".dcm");
    TF_RETURN_IF_ERROR(SaveDicomFile(path, &object));
    written_.push_back({identity.key, std::move(path), std::string(identity.class_uid), uid,
                        input_.uids.at(SeriesKeyOf(identity.key))});
    return absl::OkStatus();
  }

  std::vector<WrittenObject> Take() { return std::move(written_); }

 private:
  const PredictionObjectsInput& input_;
  DcmDataset* source_;
  std::string folder_;
  std::vector<WrittenObject> written_;
};

absl::Status WriteModels(const PredictionObjectsInput& input, const PredictedCase& predicted,
                         StudyFiles* writer) {
  ObjectIdentity identity{.class_uid = kEncapsulatedStlClass,
                          .modality = "M3D",
                          .series_number = kModelsSeries,
                          .description = "Predicted face, models",
                          .in_frame = true};
  for (const std::string& key : ObjectKeys(input.contents)) {
    if (!absl::StartsWith(key, "stl:")) continue;
    identity.key = key;
    const ModelSurface model = ModelOfKey(key, input.contents, predicted);
    TF_RETURN_IF_ERROR(writer->Write(
        identity, [&](DcmDataset* object) { return WriteStlModules(input, model, object); }));
    ++identity.instance_number;
  }
  return absl::OkStatus();
}

std::string StudyOf(DcmDataset* source) {
  OFString uid;
  source->findAndGetOFString(DCM_StudyInstanceUID, uid);
  return uid.c_str();
}

}  // namespace

absl::StatusOr<std::vector<WrittenObject>> WritePredictionObjects(
    const PredictionObjectsInput& input, const std::string& folder) {
  TF_RETURN_IF_ERROR(CheckPredictionInput(input));
  TF_ASSIGN_OR_RETURN(const PredictedCase predicted,
                      PredictCase(input.contents, input.deformed, PosesOf(input.prediction)));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<DcmFileFormat> file,
                      LoadDicomHeader(input.source_header));
  DcmDataset* source = file->getDataset();
  TF_RETURN_IF_ERROR(CheckSource(source));
  StudyFiles writer(input, source, folder);
  TF_RETURN_IF_ERROR(WriteModels(input, predicted, &writer));
  TF_RETURN_IF_ERROR(
      writer.Write({.key = "capture",
                    .class_uid = kColourCaptureClass,
                    .modality = "OT",
                    .series_number = kCaptureSeries,
                    .description = "Predicted face, pictures"},
                   [&](DcmDataset* object) { return WriteCaptureModules(input, object); }));
  TF_RETURN_IF_ERROR(writer.Write({.key = "report",
                                   .class_uid = kComprehensiveSrClass,
                                   .modality = "SR",
                                   .series_number = kReportSeries,
                                   .description = "Predicted face, report"},
                                  [&](DcmDataset* object) {
                                    return WriteReportModules(input, predicted, StudyOf(source),
                                                              object);
                                  }));
  return writer.Take();
}

}  // namespace tissueform
