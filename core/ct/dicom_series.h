// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/ct/dicom_file.h"
#include "core/ct/dicom_stack.h"

namespace tissueform {

// Which files of a folder to take: those of the series of one of them, or of a series number.
struct SeriesChoice {
  std::string series_uid;            // empty: not chosen by a file
  std::optional<int> series_number;  // the recipe's key
};

// Finds the one series of CT slices among all DICOM files of a folder. Files and series of other
// kinds (localiser, dose report, other modalities) are left aside, with a note.
//
// Errors: InvalidArgument when there is none, with what there is instead; when there are several,
// with a list; when the series that was asked for is not there or holds anything but CT slices.
absl::StatusOr<DicomStack> ChooseSeries(const std::vector<DicomHeader>& files,
                                        const SeriesChoice& choice);

}  // namespace tissueform
