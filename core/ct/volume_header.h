// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

enum class VolumeFormat { kNifti, kNrrd, kMetaImage };

// By its ending; nullopt for every other file.
std::optional<VolumeFormat> VolumeFormatOfPath(const std::string& path);

// What ITK does not tell of a file of NRRD or MetaImage: said in the text at its head.
struct VolumeHeader {
  std::string data_path;  // of the voxels, beside the header; empty when they are in the same file

  size_t data_offset = 0;   // in MetaImage: where the voxels begin when they are in the same file
  bool compressed = false;  // MetaImage's "CompressedData"
  size_t compressed_bytes = 0;  // "CompressedDataSize"; 0 where it is missing

  // "space" of NRRD, "AnatomicalOrientation" of MetaImage; empty where the file has none.
  std::string orientation;
};

// Reads the text at the head of a file of NRRD or MetaImage.
//
// Errors: InvalidArgument when the file does not begin as its ending says; when the voxels are
// spread over several files or lie in another folder (a header from outside must not choose what is
// read).
absl::StatusOr<VolumeHeader> ReadVolumeHeader(const std::string& path, VolumeFormat format);

}  // namespace tissueform
