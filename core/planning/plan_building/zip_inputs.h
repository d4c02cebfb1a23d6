// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/archive/unpacked_zip.h"

namespace tissueform {

enum class ZipContent { kCt, kLabels, kSurfaces };

// Inputs that may come in zips. Unpacked files go with this object.
class ZipInputs {
 public:
  // `parent`: where zips are unpacked.
  explicit ZipInputs(std::string parent) : parent_(std::move(parent)) {}

  // What is to be read in place of `path`: `path` itself unless it is a zip. Of a zip with a CT the
  // one volume file, or the folder where it holds DICOM; of one with labels the one file; of one
  // with surfaces the one surfaces file.
  //
  // Errors: those of UnpackedZip::Unpack; InvalidArgument when several files may be meant. They
  // are listed by their number in order of names, because names may hold a patient's.
  absl::StatusOr<std::string> Resolve(const std::string& path, ZipContent content);

 private:
  const std::string parent_;
  std::vector<UnpackedZip> unpacked_;
};

}  // namespace tissueform
