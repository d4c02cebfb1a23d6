// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/stl_object.h"

#include <cstring>

#include "absl/strings/str_cat.h"
#include <Eigen/Geometry>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/objects/model_icon.h"

namespace tissueform {
namespace {

constexpr size_t kStlHeaderBytes = 80;
constexpr size_t kStlTriangleBytes = 50;
// Not "solid", by which readers know the form in text.
constexpr char kStlHeader[] = "Tissueform, mm, DICOM LPS. Research, not a medical device";

template <typename T>
void AppendBytes(const T& value, std::vector<uint8_t>* bytes) {
  const auto* first = reinterpret_cast<const uint8_t*>(&value);
  bytes->insert(bytes->end(), first, first + sizeof(T));
}

void AppendPoint(const Eigen::Vector3f& point, std::vector<uint8_t>* bytes) {
  for (const float coordinate : point) AppendBytes(coordinate, bytes);
}

void WriteIcon(const PredictionObjectsInput& input, const ModelSurface& surface,
               ItemWriter* writer) {
  ItemWriter icon = writer->NewItem(DCM_IconImageSequence);
  icon.Number(DCM_SamplesPerPixel, 1);
  icon.Text(DCM_PhotometricInterpretation, "MONOCHROME2");
  icon.Number(DCM_Rows, kIconPixels);
  icon.Number(DCM_Columns, kIconPixels);
  icon.Number(DCM_BitsAllocated, 8);
  icon.Number(DCM_BitsStored, 8);
  icon.Number(DCM_HighBit, 7);
  icon.Number(DCM_PixelRepresentation, 0);
  icon.Bytes(DCM_PixelData,
             DrawModelIcon(surface.positions, surface.triangles, input.contents.head_frame));
  writer->Take(icon);
}

void WriteAlgorithm(const PredictionObjectsInput& input, bool modified, ItemWriter* writer) {
  ItemWriter algorithm = writer->NewItem(DCM_DerivationAlgorithmSequence);
  algorithm.Code(DCM_AlgorithmFamilyCodeSequence,
                 modified ? OwnTerm("PREDICTION", "Soft tissue prediction")
                          : OwnTerm("SURFACE", "Surface from CT"));
  algorithm.Text(DCM_AlgorithmName,
                 modified ? PlainDicomText(absl::StrCat("Tissueform ", input.contents.model), 64)
                          : "Tissueform plan build");
  algorithm.Text(
      DCM_AlgorithmVersion,
      PlainDicomText(modified ? input.prediction.software_version() : input.contents.software, 64));
  writer->Take(algorithm);
}

void WriteSourceInstances(const PredictionObjectsInput& input, ItemWriter* writer) {
  for (const SourceImage& image : input.source_images) {
    ItemWriter item = writer->NewItem(DCM_SourceInstanceSequence);
    item.Text(DCM_ReferencedSOPClassUID, image.class_uid);
    item.Text(DCM_ReferencedSOPInstanceUID, image.instance_uid);
    writer->Take(item);
  }
}

void WriteDocument(const PredictionObjectsInput& input, const ModelSurface& surface,
                   std::vector<uint8_t> stl, ItemWriter* writer) {
  writer->Text(DCM_AcquisitionDateTime, "");
  writer->Text(DCM_BurnedInAnnotation, "NO");
  writer->Text(DCM_RecognizableVisualFeatures, "YES");
  WriteSourceInstances(input, writer);
  writer->Text(DCM_DocumentTitle, absl::StrCat(surface.title, ". ", kResearchNotice));
  writer->Code(DCM_ConceptNameCodeSequence, surface.kind);
  writer->Text(DCM_MIMETypeOfEncapsulatedDocument, "model/stl");
  writer->LongNumber(DCM_EncapsulatedDocumentLength, static_cast<uint32_t>(stl.size()));
  if (stl.size() % 2 == 1) stl.push_back(0);
  writer->Bytes(DCM_EncapsulatedDocument, stl);
}

}  // namespace

std::vector<uint8_t> BinaryStl(const ModelSurface& surface) {
  std::vector<uint8_t> bytes(kStlHeaderBytes, 0);
  std::memcpy(bytes.data(), kStlHeader, sizeof(kStlHeader) - 1);
  const auto count = static_cast<size_t>(surface.triangles.rows());
  bytes.reserve(kStlHeaderBytes + 4 + kStlTriangleBytes * count);
  AppendBytes(static_cast<uint32_t>(count), &bytes);
  for (const auto& triangle : surface.triangles.rowwise()) {
    const auto corner = [&](int k) -> Eigen::Vector3f {
      return surface.positions.row(triangle[k]);
    };
    AppendPoint((corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized(), &bytes);
    for (int k = 0; k < 3; ++k) AppendPoint(corner(k), &bytes);
    AppendBytes(uint16_t{0}, &bytes);
  }
  return bytes;
}

absl::Status WriteStlModules(const PredictionObjectsInput& input, const ModelSurface& surface,
                             DcmDataset* object) {
  if (surface.triangles.rows() > kMaxSurfaceTriangles) {
    return absl::ResourceExhaustedError(absl::StrCat("a model has ", surface.triangles.rows(),
                                                     " triangles; at most ", kMaxSurfaceTriangles,
                                                     " are written"));
  }
  ItemWriter writer(object);
  WriteDocument(input, surface, BinaryStl(surface), &writer);
  writer.Code(DCM_MeasurementUnitsCodeSequence, {"mm", "UCUM", "mm"});
  writer.Text(DCM_ModelModification, surface.modified ? "YES" : "NO");
  writer.Text(DCM_ModelMirroring, "NO");
  writer.Text(DCM_ModelGroupUID, input.uids.at("group"));
  WriteIcon(input, surface, &writer);
  WriteAlgorithm(input, surface.modified, &writer);
  return writer.status();
}

}  // namespace tissueform
