// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/dicom_header.h"
#include "core/imaging/ct/dicom_stack.h"

namespace tissueform {

// Which files of a folder to take: the scan of one of them, or of a series number.
struct SeriesChoice {
  int file_number = 0;               // 0: not chosen by a file
  std::optional<int> series_number;  // the recipe's key
  JoinSeries join = JoinSeries::kAuto;
  bool has_offset = false;  // whether the recipe states how values become HU
};

// Finds the one CT among all DICOM files of a folder: joins series that belong together
// (slice_groups.h) and parts scans that lie among each other (slice_acquisitions.h), each with a
// note. What is left aside (localiser, dose report, other modalities, series too short for a
// volume, the smaller of two scans) is noted, too, and so is what lies in the series itself and is
// no CT slice.
//
// Of several CTs of one study the default rule of the bridge (SeriesRule) chooses, with a note. It
// does not choose between patients, studies, scans within one series and consecutive parts of a
// scan, nor where Enhanced CT is among them, which it does not measure.
//
// Errors: InvalidArgument when the folder has none, listing what it has; when there are several
// and the rule chooses none, with the largest of them, what the rule finds and how to choose; when
// what was asked for is not there, holds no CT slice, or holds what may be slices that are not read
// (multi-frame, cut off).
absl::StatusOr<DicomStack> ChooseSeries(const std::vector<DicomHeader>& files,
                                        const SeriesChoice& choice);

}  // namespace tissueform
