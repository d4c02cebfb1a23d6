// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-ct-reader: reads a CT through ITK and GDCM for another program of ours.

#include <filesystem>

#include "core/base/lfs_pointer.h"
#include "core/base/status_macros.h"
#include "core/imaging/ct/ct_reader_call.h"
#include "core/imaging/ct/dicom_volume_reader.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/volume_file_reader.h"

namespace tissueform {
namespace {

absl::StatusOr<CtVolume> Read(const std::string& given_path, const CtReadOptions& options) {
  const std::string path = std::filesystem::absolute(given_path).lexically_normal().string();
  const bool is_folder = std::filesystem::is_directory(path);
  if (!is_folder && IsLfsPointerFile(path)) return absl::InvalidArgumentError(kLfsPointerMessage);
  const std::optional<VolumeFormat> format = VolumeFormatOfPath(path);
  return !is_folder && format ? ReadVolumeFile(path, *format, options)
                              : ReadDicomVolume(path, options);
}

}  // namespace
}  // namespace tissueform

int main() { return tissueform::RunCtReader(tissueform::Read); }
