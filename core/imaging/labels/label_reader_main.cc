// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-label-reader: reads a label map through ITK and GDCM for another program of ours.

#include <filesystem>
#include <optional>

#include "core/base/lfs_pointer.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/volume_header.h"
#include "core/imaging/labels/dicom_seg_reader.h"
#include "core/imaging/labels/label_folder_reader.h"
#include "core/imaging/labels/label_reader_call.h"
#include "core/imaging/labels/label_volume_reader.h"

namespace tissueform {
namespace {

absl::StatusOr<LabelMap> Read(const std::string& given_path, const LabelReadOptions& options) {
  const std::string path = std::filesystem::absolute(given_path).lexically_normal().string();
  if (std::filesystem::is_directory(path)) return ReadLabelFolder(path, options);
  if (IsLfsPointerFile(path)) return absl::InvalidArgumentError(kLfsPointerMessage);
  if (IsDicomFile(path)) return ReadDicomSeg(path, options);
  if (const std::optional<VolumeFormat> format = VolumeFormatOfPath(path)) {
    return ReadLabelVolume(path, *format, options);
  }
  return absl::InvalidArgumentError(
      "it is not a DICOM file, and its ending is not .nrrd .nhdr .nii .nii.gz .mha or .mhd");
}

}  // namespace
}  // namespace tissueform

int main() { return tissueform::RunLabelReader(tissueform::Read); }
