// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/LU>

#include "core/imaging/ct/dicom_series.h"
#include "core/imaging/ct/dicom_stack.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/volume_header.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/fuzzed_file.h"

namespace tissueform::fuzz {
namespace {

void Require(bool promise) {
  if (!promise) std::abort();
}

// A header from outside must not choose what is read.
void CheckDataPath(const std::string& header_path, const VolumeHeader& header) {
  Require(header.data_paths.size() <= kMaxDataFiles);
  for (const std::string& path : header.data_paths) {
    const std::filesystem::path data(path);
    Require(data.parent_path() == std::filesystem::path(header_path).parent_path());
    Require(data.filename() != ".." && data.filename() != ".");
  }
}

std::optional<double> MaybeNumber(ByteSource* source) {
  const auto choice = source->Take<uint8_t>();
  if (choice % 4 == 0) return std::nullopt;
  return choice % 4 == 1 ? source->Take<double>() : source->Take<int8_t>();
}

double FiniteNumber(ByteSource* source) {  // as ReadDicomHeader lets through
  const auto number = source->Take<double>();
  return std::isfinite(number) ? number : 0;
}

// What distinguishes scans, series and frames; torn apart in any way.
void TakeOrigin(ByteSource* source, DicomHeader* header) {
  const auto name = [source] { return std::string(1, source->Take<char>()); };
  header->series_uid += name();
  header->frame_uid = name();
  header->reconstruction = name();
  header->patient = std::string(source->Take<uint8_t>() % 2, 'p');
  header->acquisition_time_s = MaybeNumber(source);
  if (header->acquisition_time_s && !std::isfinite(*header->acquisition_time_s)) {
    header->acquisition_time_s.reset();  // as SecondsOf
  }
  header->acquisition_number = source->Take<uint8_t>() % 4;
  header->num_frames = 1 + source->Take<uint8_t>() % 3;
  header->frame = header->num_frames - 1;
}

// Mostly a slice that belongs to the others; the bits of a byte say what does not.
DicomHeader TakeHeader(int number, ByteSource* source) {
  const auto odd = source->Take<uint8_t>();
  DicomHeader header;
  header.file_number = number;
  header.kind = DicomKind::kCtSlice;
  if ((odd & 1) != 0) header.kind = static_cast<DicomKind>(source->Take<uint8_t>() % 10);
  header.modality = "CT";
  header.series_uid = (odd & 2) != 0 ? "1.3" : "1.2";
  header.class_uid = std::string(kCtImageClass);
  header.study_uid = "1.4";
  header.series_number = (odd & 2) != 0 ? 2 : 1;
  header.instance_number = source->Take<int8_t>();
  header.rows = (odd & 4) != 0 ? source->Take<uint16_t>() : 4;
  header.columns = 4;
  header.position_mm = Eigen::Vector3d(0, 0, source->Take<int8_t>());
  header.axes = Eigen::Matrix<double, 3, 2>::Identity();
  header.pixel_spacing_mm = Eigen::Vector2d(0.5, 0.5);
  if ((odd & 8) != 0) header.position_mm->x() = FiniteNumber(source);
  if ((odd & 16) != 0) header.axes->col(0).y() = FiniteNumber(source);
  if ((odd & 32) != 0) header.pixel_spacing_mm->x() = FiniteNumber(source);
  if ((odd & 64) != 0) header.position_mm.reset();
  if ((odd & 128) != 0) {
    header.rescale_slope = MaybeNumber(source);
    header.rescale_intercept = MaybeNumber(source);
    TakeOrigin(source, &header);
  }
  return header;
}

}  // namespace

// The file itself is GDCM's to read, in a helper program that may crash; what comes of it is ours.
void FuzzDicomSeries(const uint8_t* data, size_t size) {
  ByteSource source(data, size);
  SeriesChoice choice;
  const auto chosen = source.Take<uint8_t>();
  if (chosen % 4 == 1) choice.series_number = 1;
  if (chosen % 4 == 2) choice.file_number = 1 + chosen % 7;
  choice.join = static_cast<JoinSeries>(chosen / 4 % 3);
  const bool has_offset = source.Take<uint8_t>() % 2 == 1;
  std::vector<DicomHeader> files;
  while (source.left() > 0 && files.size() < 64) {
    files.push_back(TakeHeader(static_cast<int>(files.size()) + 1, &source));
  }
  absl::StatusOr<DicomStack> stack = ChooseSeries(files, choice);
  Require(stack.ok() || !stack.status().message().empty());
  if (!stack.ok() || !ArrangeStack(has_offset, &*stack).ok()) return;
  Require(stack->spacing_mm.allFinite() && stack->spacing_mm.minCoeff() > 0);
  // Sheared by the tilt at most; every slice has its place, rising.
  for (int axis = 0; axis < 3; ++axis) {
    Require(std::abs(stack->direction.col(axis).norm() - 1) < 1e-3);
  }
  Require(std::abs(stack->direction.determinant()) > 0.5);
  Require(stack->slices.size() <= files.size());
  Require(stack->slice_origins_mm.empty() ||
          stack->slice_origins_mm.size() == stack->slices.size());
}

void FuzzVolumeHeader(const uint8_t* data, size_t size) {
  const FuzzedFile file(data, size);
  for (const VolumeFormat format :
       {VolumeFormat::kNifti, VolumeFormat::kNrrd, VolumeFormat::kMetaImage}) {
    const absl::StatusOr<VolumeHeader> header = ReadVolumeHeader(file.path(), format);
    if (header.ok()) {
      CheckDataPath(file.path(), *header);
      Require(header->data_offset <= size);
    } else {
      Require(!header.status().message().empty());
    }
  }
  const absl::string_view bytes(reinterpret_cast<const char*>(data), size);
  Require(UnpackedSize(bytes, 1 << 20) >= 0);
}

}  // namespace tissueform::fuzz
