// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform {

enum class VolumeFormat { kNifti, kNrrd, kMetaImage };

// By its ending; nullopt for every other file.
std::optional<VolumeFormat> VolumeFormatOfPath(const std::string& path);

// What ITK does not report about a file of NRRD or MetaImage: stated in the text at its head.
struct VolumeHeader {
  // Of the voxels, beside the header, in their order; empty when they are in the same file.
  std::vector<std::string> data_paths;

  size_t data_offset = 0;   // in MetaImage: where the voxels begin when they are in the same file
  bool compressed = false;  // MetaImage's "CompressedData"
  size_t compressed_bytes = 0;  // "CompressedDataSize"; 0 where it is missing

  // "space" of NRRD, "AnatomicalOrientation" of MetaImage; empty where the file has none.
  std::string orientation;
};

// Files that one NRRD header may name.
inline constexpr int kMaxDataFiles = 20000;

// Reads the text at the head of a file of NRRD or MetaImage. Voxels may be spread over several
// files in NRRD: numbered ("slice%03d.raw 1 93 1") or listed ("LIST").
//
// Errors: InvalidArgument when the file does not begin as its ending says; when voxels lie in
// another folder (a header from outside must not choose what is read); when a MetaImage's are
// spread over several files. ResourceExhausted beyond kMaxDataFiles.
absl::StatusOr<VolumeHeader> ReadVolumeHeader(const std::string& path, VolumeFormat format);

}  // namespace tissueform
