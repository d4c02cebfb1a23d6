// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/dicom_header.h"

namespace tissueform {

// Fewer make no volume.
inline constexpr size_t kLeastSlices = 8;

// Slices that their headers, or we, take for one series.
struct SliceGroup {
  std::vector<DicomHeader> slices;
  int num_series = 1;  // that were joined
};

// By patient and series, in the order of their numbers and first files.
std::vector<SliceGroup> GroupBySeries(const std::vector<DicomHeader>& files);

// Within what rounding in decimal headers leaves. REQUIRES: axes.
bool HaveSameAxes(const DicomHeader& a, const DicomHeader& b);

// Of one patient, size, orientation, pixel spacing, rescale and patient position, all with a place.
bool CanBeOneVolume(const SliceGroup& a, const SliceGroup& b);

// Whether all slices of two such groups have places, and those of one follow those of the other.
bool AreApart(const SliceGroup& a, const SliceGroup& b);

// Joins groups that are one CT although their files name several series. What differs in patient,
// size or orientation is never joined. kAuto joins, of one reconstruction (kernel, voltage, phase):
//   fragments (fewer than kLeastSlices) in one frame of reference, with each other and with the one
//   whole group of it;
//   fragments whose frames of reference are torn apart, too;
//   whole groups of one study and frame of reference that follow each other: two that overlap are
//   two reconstructions or phases.
std::vector<SliceGroup> JoinGroups(std::vector<SliceGroup> groups, JoinSeries join);

}  // namespace tissueform
