// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/imaging/ct/dicom_header.h"

namespace gdcm {
class DataSet;
}

namespace tissueform {

// The images of a multi-frame file (Enhanced CT), each as the header of a slice: `file` with the
// position, orientation, pixel spacing, rescale and times of the frame, from the functional groups
// that are shared or its own (DICOM PS3.3, C.7.6.16). A file of the plain CT class without such
// groups has its frames along the normal, SpacingBetweenSlices apart from the position of the file.
// Empty where the file does not distinguish its frames. In a helper program only. Internal to
// core/imaging/ct.
std::vector<DicomHeader> FramesOf(const gdcm::DataSet& data, const DicomHeader& file);

}  // namespace tissueform
