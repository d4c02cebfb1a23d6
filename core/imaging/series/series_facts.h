// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/imaging/series/image_header.h"
#include "core/imaging/series/kernel_kind.h"

namespace tissueform {

enum class SliceOrientation { kAxial, kCoronal, kSagittal, kOblique, kNone };

// What a series is, by its images' headers: what rules decide by. The images are its CT slices or,
// where it has none, its objects of the most frequent kind: what else came in the series (a capture
// of a screen, a report, a scout) says nothing of the scan. Numbers are of the slices that lie at
// different places.
struct SeriesFacts {
  std::string key = {};  // the caller's name for it
  std::string study_uid = {};
  std::string modality = {};
  std::string description = {};  // for rules only, never in a text: it may hold anything
  int number = 0;
  int images = 0;
  int set_aside = 0;  // objects of the series that are not its images
  int slices = 0;
  int duplicates = 0;  // images at a place that another image has
  int missing = 0;     // places between the first and the last that have no image
  int frames_of_reference = 0;
  int orientations = 0;
  SliceOrientation plane = SliceOrientation::kNone;
  double spacing_mm = 0;  // between slices: the median
  double thickness_mm = 0;
  double coverage_mm = 0;  // along the slices' normal
  KernelKind kernel = KernelKind::kUnknown;
  bool contrast = false;
  bool localiser = false;
  bool derived = false;
  bool multi_frame = false;    // Enhanced CT: nothing above is known of its frames
  int without_hounsfield = 0;  // images that do not say how their values become Hounsfield units
};

// REQUIRES: headers of one series, at least one.
SeriesFacts FactsOfSeries(const std::string& key, const std::vector<ImageHeader>& objects);

// "231 axial slices, 0.60 mm apart, over 138 mm, soft kernel", for people; nothing of a patient.
std::string DescribeFacts(const SeriesFacts& facts);

}  // namespace tissueform
