// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/meta_image.h"

#include <bit>
#include <zlib.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little, "voxels are written as they are");

// CT noise hardly shrinks further at higher levels, which take several times as long.
constexpr int kLevel = 1;

absl::StatusOr<std::string> Compressed(const std::vector<int16_t>& values) {
  const auto bytes = static_cast<uLong>(values.size() * sizeof(int16_t));
  uLongf size = compressBound(bytes);
  std::string packed(size, '\0');
  const int result = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(values.data()), bytes, kLevel);
  if (result != Z_OK) return absl::ResourceExhaustedError("no memory to compress the CT");
  packed.resize(size);
  return packed;
}

// 17 digits: the same number when it is read again.
void AppendNumbers(const char* key, const Eigen::Ref<const Eigen::VectorXd>& values,
                   std::string* header) {
  absl::StrAppend(header, key, " =");
  for (const double value : values) absl::StrAppendFormat(header, " %.17g", value);
  absl::StrAppend(header, "\n");
}

}  // namespace

absl::StatusOr<std::string> MetaImageOf(const CtVolume& volume) {
  if (!volume.slice_origins_mm.empty()) {
    return absl::FailedPreconditionError(
        "the slices are not evenly spaced, which one volume file cannot hold; build this plan on "
        "this machine, without --server");
  }
  TF_ASSIGN_OR_RETURN(const std::string packed, Compressed(volume.hu));
  // The letters are a formality that readers of this project expect; the matrix places the voxels.
  std::string file =
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "CompressedData = True\n";
  absl::StrAppend(&file, "CompressedDataSize = ", packed.size(), "\n");
  // Column after column: the direction of i, then of j, then of k.
  AppendNumbers("TransformMatrix", volume.direction.reshaped(), &file);
  AppendNumbers("Offset", volume.origin_mm, &file);
  absl::StrAppend(&file, "AnatomicalOrientation = RAI\n");
  AppendNumbers("ElementSpacing", volume.spacing_mm, &file);
  absl::StrAppend(&file, "DimSize = ", volume.size[0], " ", volume.size[1], " ", volume.size[2],
                  "\nElementType = MET_SHORT\nElementDataFile = LOCAL\n", packed);
  return file;
}

}  // namespace tissueform
