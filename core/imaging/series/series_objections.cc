// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/series_objections.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace tissueform {
namespace {

// Two numbers that are read from headers are the same.
constexpr double kSameMm = 0.01;

std::string OtherModality(const std::string& modality) {
  // From a header: only a value in the form of a modality is repeated in the message.
  const bool is_name =
      modality.size() <= 16 && std::all_of(modality.begin(), modality.end(), [](unsigned char c) {
        return absl::ascii_isupper(c) || absl::ascii_isdigit(c);
      });
  if (modality == "MR") {
    return "its modality is MR, which has no Hounsfield units for bone and skin; send a "
           "CT";
  }
  return absl::StrCat("its modality is ", is_name && !modality.empty() ? modality : "unknown");
}

bool HasAnyWord(const std::string& text, const std::vector<std::string>& words) {
  return std::any_of(words.begin(), words.end(), [&text](const std::string& word) {
    return absl::StrContains(absl::AsciiStrToLower(text), absl::AsciiStrToLower(word));
  });
}

void CheckSlices(const SeriesFacts& series, const SeriesRule& rule,
                 std::vector<std::string>* against) {
  const auto add = [against](std::string why) { against->push_back(std::move(why)); };
  if (series.slices < rule.min_slices) {
    add(absl::StrCat("it has ", series.slices, " slices, fewer than ", rule.min_slices));
    // All that follows would say the same again.
    return;
  }
  if (series.missing > rule.max_missing) {
    add(absl::StrCat(series.missing, " slices are missing between the first and the last"));
  }
  if (series.duplicates > 0) {
    add(absl::StrCat(series.duplicates, " images have the position of another one"));
  }
  if (series.frames_of_reference > 1) {
    add(absl::StrCat("its images have ", series.frames_of_reference, " frames of reference"));
  }
  if (series.orientations > 1) add("its images have different orientations");
  if (rule.axial_only && series.plane != SliceOrientation::kAxial) add("its slices are not axial");
  if (series.spacing_mm > rule.max_spacing_mm + kSameMm) {
    add(absl::StrFormat("its slices are %.2f mm apart, more than %.2f", series.spacing_mm,
                        rule.max_spacing_mm));
  }
  if (series.thickness_mm > rule.max_thickness_mm + kSameMm) {
    add(absl::StrFormat("its slices are %.2f mm thick, more than %.2f", series.thickness_mm,
                        rule.max_thickness_mm));
  }
  if (series.coverage_mm < rule.min_coverage_mm || series.coverage_mm > rule.max_coverage_mm) {
    add(absl::StrFormat("it covers %.0f mm, not %.0f to %.0f", series.coverage_mm,
                        rule.min_coverage_mm, rule.max_coverage_mm));
  }
}

// Advice to state an offset is for a series of which no image says how: where some do, the values
// of the others are not known.
void CheckHounsfield(const SeriesFacts& series, std::vector<std::string>* against) {
  if (series.without_hounsfield == 0) return;
  against->push_back(series.without_hounsfield < series.images
                         ? absl::StrCat(series.without_hounsfield, " of its ", series.images,
                                        " images have no Hounsfield calibration, the others "
                                        "have one; send the series again")
                         : "it has no Hounsfield calibration, like some cone-beam CTs; a recipe "
                           "with hu_offset accepts it (in the bridge with a rule that has "
                           "\"hounsfield\": false)");
}

}  // namespace

std::string WhatIsAgainst(const SeriesFacts& series, const SeriesRule& rule) {
  if (series.modality != rule.modality) return OtherModality(series.modality);
  if (series.localiser) return "it is a localizer (scout)";
  if (series.multi_frame) {
    return "its images are multi-frame (Enhanced CT), which rules do not measure; choose "
           "it with tissueform-pacs build, or send single-frame CT images";
  }
  std::vector<std::string> against;
  if (rule.hounsfield) CheckHounsfield(series, &against);
  CheckSlices(series, rule, &against);
  if (series.derived && !rule.derived) against.emplace_back("it is derived from another series");
  if (series.contrast && !rule.contrast) against.emplace_back("it has contrast medium");
  if (!rule.description_has.empty() && !HasAnyWord(series.description, rule.description_has)) {
    against.emplace_back("its description has none of the rule's words");
  }
  if (HasAnyWord(series.description, rule.description_lacks)) {
    against.emplace_back("its description has a word that the rule excludes");
  }
  return absl::StrJoin(against, "; ");
}

}  // namespace tissueform
