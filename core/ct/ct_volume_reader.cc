// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/ct_volume_reader.h"

#include <cmath>
#include <filesystem>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/ct/ct_volume_pipe.h"
#include "core/ct/dicom_volume_reader.h"
#include "core/ct/hu_check.h"
#include "core/ct/patient_axes.h"
#include "core/ct/volume_file_reader.h"
#include "core/process/isolated_process.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "reading the CT";

absl::StatusOr<CtVolume> ReadHere(const std::string& given_path, const CtReadOptions& options) {
  const std::string path = std::filesystem::absolute(given_path).lexically_normal().string();
  const bool is_folder = std::filesystem::is_directory(path);
  const std::optional<VolumeFormat> format = VolumeFormatOfPath(path);
  TF_ASSIGN_OR_RETURN(CtVolume volume, !is_folder && format ? ReadVolumeFile(path, *format, options)
                                                            : ReadDicomVolume(path, options));
  TF_RETURN_IF_ERROR(CheckHu(volume.hu, options.hu_offset));
  return volume;
}

absl::StatusOr<CtVolume> ReadInChild(const std::string& path, const CtReadOptions& options,
                                     const IsolationLimits& isolation) {
  absl::StatusOr<CtVolume> volume = absl::InternalError("not read");
  const absl::Status status = WithoutExceptions(kWhat, isolation, [&] {
    volume = ReadHere(path, options);
    return volume.status();
  });
  if (!status.ok()) return status;
  return volume;
}

absl::Status CheckRequest(const std::string& path, const CtReadOptions& options) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    return absl::NotFoundError("there is no such file or folder");
  }
  if (options.hu_offset && !(std::abs(*options.hu_offset) <= 32768)) {
    return absl::InvalidArgumentError("\"hu_offset\" of the recipe must lie within +-32768");
  }
  return options.axes.empty() ? absl::OkStatus() : CheckAxes(options.axes);
}

absl::Status WithSubject(const absl::Status& status) {
  return {status.code(), absl::StrCat("cannot use the CT: ", status.message())};
}

}  // namespace

absl::StatusOr<CtVolume> ReadCtVolume(const std::string& path, const CtReadOptions& options) {
  if (const absl::Status status = CheckRequest(path, options); !status.ok()) {
    return WithSubject(status);
  }
  const IsolationLimits isolation{options.limits.max_memory_bytes, options.limits.max_seconds};
  absl::StatusOr<CtVolume> volume = absl::InternalError("not received");
  const absl::Status status = RunIsolated(
      kWhat, isolation,
      [&](int descriptor) {
        return SendCtVolume(descriptor, ReadInChild(path, options, isolation));
      },
      [&](int descriptor) {
        volume = ReceiveCtVolume(descriptor, options.limits.max_voxels);
        return volume.status();
      });
  if (!status.ok()) return WithSubject(status);
  return volume;
}

}  // namespace tissueform
