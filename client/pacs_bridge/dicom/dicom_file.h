// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

class DcmDataset;
class DcmFileFormat;

// DICOM files in and out, as DCMTK's datasets. Messages name the file, never what it says of a
// patient.
namespace tissueform {

// What a file may be to be read. A CT slice has half a MiB and some tens of items.
struct DicomLimits {
  int64_t max_file_bytes = int64_t{1} << 30;
  // Marks of items in the file. DCMTK reads items within items by calling itself, so that a small
  // file of nothing but openings would exhaust the stack.
  int max_items = 4096;
};

// Silences DCMTK, whose log lines hold values of patients, and finds its dictionary. Everything in
// this folder and in network calls it; any thread, costs nothing the second time.
//
// Errors: FailedPrecondition when DCMTK's data dictionary is not there.
absl::Status PrepareDcmtk();

// The data set of a DICOM file (PS3.10) up to its pixels, with its meta header. Values over 64 KiB
// stay in the file until they are asked for, so it has to stay too.
//
// Errors: NotFound, InvalidArgument (no DICOM file, cut off, deflated, over a limit), with the
// path.
absl::StatusOr<std::unique_ptr<DcmFileFormat>> LoadDicomHeader(const std::string& path,
                                                               const DicomLimits& limits = {});

// Writes a data set as explicit little endian, all or nothing, readable by its owner alone (0600),
// synced.
//
// Errors: those of PartialFile (a full disk is DISK_FULL); InvalidArgument when DCMTK cannot write
// it.
absl::Status SaveDicomFile(const std::string& path, DcmDataset* dataset);

// Copies a file's header, without pixels and without private elements, to another: enough to give
// what is written later the same patient and study.
//
// Errors: those of both.
absl::Status CopyHeaderOnly(const std::string& from, const std::string& to,
                            const DicomLimits& limits = {});

}  // namespace tissueform
