// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/series/image_header.h"

namespace tissueform {

// What a DICOM file holds, as far as a CT volume is concerned.
enum class DicomKind {
  kCtSlice,
  kLocaliser,
  kSecondaryCapture,  // a photograph, or a copy of a screen
  kOtherModality,
  kMultiFrame,  // that does not say where its frames lie
  kColour,
  kDeflated,   // its whole data set is compressed (1.2.840.10008.1.2.1.99)
  kNoImage,    // a report, a dose sheet
  kDirectory,  // DICOMDIR
  kDamaged,    // begins as a DICOM file but is not one to its end, is a CT image without size, or
               // is only zeros
};

// The header of one image: of a file, or of a frame of a multi-frame file. Texts and UIDs, except
// the modality, are for comparison only, never in a message: they may name the patient. Their bytes
// are the file's, undecoded. series_description stays empty: nothing here needs
// it. The class of a CT slice that names none is kCtImageClass.
struct DicomHeader : ImageHeader {
  std::string path;     // never in a message: it may name the patient
  int file_number = 0;  // place in the folder, in order of names, from 1

  DicomKind kind = DicomKind::kNoImage;
  int frame = 0;  // of the file's images, from 0
  int num_frames = 1;
  bool even_frames = false;  // placed by SpacingBetweenSlices, as the file has no place for each

  std::string patient;
  std::string patient_position;              // "HFS"
  std::string reconstruction;                // kernel, voltage, phase: the same in one volume
  std::optional<double> acquisition_time_s;  // all three from some day
  std::optional<double> series_time_s;
  std::optional<double> content_time_s;

  bool was_lossy = false;   // compressed with loss at some time (0028,2110)
  size_t pixel_offset = 0;  // where in the file the pixels begin
};

// "file 12 of the folder (instance number 31)".
std::string NameOf(const DicomHeader& header);

// "a photograph or copy of a screen (secondary capture)", "of modality MR", ...
std::string DescribeKind(const DicomHeader& header);

// Reads a header up to its pixels: one, or one for each frame of a multi-frame file. Empty when the
// file is no DICOM file. In a helper program only: GDCM is not safe from damaged files. Internal to
// core/imaging/ct.
std::vector<DicomHeader> ReadDicomHeaders(const std::string& path);

// Stored values of a file's image, row after row, or of all its frames one after the other, from
// its contents: rescale not applied. In a helper program only.
//
// Errors: InvalidArgument when the file is cut off or its pixels cannot be decoded.
absl::StatusOr<std::vector<float>> DecodeDicomPixels(const DicomHeader& header,
                                                     const std::string& contents);

}  // namespace tissueform
