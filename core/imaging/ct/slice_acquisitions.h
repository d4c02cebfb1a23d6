// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/imaging/ct/dicom_header.h"

namespace tissueform {

// Slices that were taken together.
struct Acquisition {
  std::vector<DicomHeader> slices;
  std::string separated_by;  // "acquisition time"; empty where there is one only
};

// Parts slices of one size and orientation where they are of several scans that lie among each
// other; the largest comes first. Scans that follow each other in space are one (thin slices, then
// thick ones), and so are those that fill each other's holes.
//
// They are parted when slices lie at one place or off the step of those about them, or when a
// minute and more lies between scans among each other. What distinguishes them is, in this order:
// the reconstruction, the series' time, study, frame of reference, series, the times of acquisition
// and content at their largest jumps, the acquisition number; and at last the place alone, when up
// to a quarter of the slices lie off the steps of the others.
std::vector<Acquisition> SeparateAcquisitions(std::vector<DicomHeader> slices);

}  // namespace tissueform
