// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/ct_volume_reader.h"

#include <cmath>
#include <filesystem>

#include "absl/strings/str_cat.h"

#include "core/imaging/ct/ct_reader_call.h"
#include "core/imaging/ct/patient_axes.h"
#include "core/imaging/ct/slice_gaps.h"

namespace tissueform {
namespace {

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
  absl::StatusOr<CtVolume> volume = CallCtReader(path, options);
  if (!volume.ok()) return WithSubject(volume.status());
  volume->provenance.wide_gaps = FindWideGaps(*volume);
  return volume;
}

}  // namespace tissueform
