// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_stack.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/ct/slice_groups.h"

namespace tissueform {
namespace {

// Of unit vectors, and relative for spacings: what rounding in decimal headers leaves.
constexpr double kSameDirection = 1e-3;
constexpr double kSamePositionMm = 0.01;
constexpr double kPositionToleranceMm = 0.1;  // positions are rounded when they are written
constexpr double kLeastSpacingMm = 0.05;
constexpr double kMaxSpacingMm = 10;
// Longer than any protocol of the head leaves out: then it is two scans.
constexpr double kMaxGapMm = 30;
constexpr double kMaxTiltDeg = 35;
constexpr double kUprightDeg = 0.05;

const char* MissingTag(const DicomHeader& slice) {
  if (!slice.position_mm || !(slice.position_mm->cwiseAbs().maxCoeff() <= kMaxPositionMm)) {
    return "position (ImagePositionPatient)";
  }
  if (!slice.axes) return "orientation (ImageOrientationPatient)";
  if (!slice.pixel_spacing_mm) return "pixel spacing (PixelSpacing)";
  return nullptr;
}

bool HasRescale(const DicomHeader& slice) { return slice.rescale_slope || slice.rescale_intercept; }

// `any_states`: some slice of the stack says how. Then an offset for all others would be a guess.
absl::Status CheckRescale(const DicomHeader& slice, bool any_states, bool may_lack_rescale) {
  const bool usable = slice.rescale_intercept && slice.rescale_slope.value_or(1) != 0;
  if (usable || (!any_states && may_lack_rescale)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(NameOf(slice), " has no calibration to HU (RescaleSlope, RescaleIntercept)",
                   any_states ? "; export the series again"
                              : "; state \"hu_offset\" in the recipe, or \"values\": \"gray\""));
}

absl::Status CheckTags(const std::vector<DicomHeader>& slices, bool may_lack_rescale) {
  const bool any_states = std::any_of(slices.begin(), slices.end(), HasRescale);
  for (const DicomHeader& slice : slices) {
    if (const char* const missing = MissingTag(slice)) {
      return absl::InvalidArgumentError(
          absl::StrCat(NameOf(slice), " has no usable ", missing, ": its position is unknown"));
    }
    TF_RETURN_IF_ERROR(CheckRescale(slice, any_states, may_lack_rescale));
  }
  return absl::OkStatus();
}

absl::Status Differs(const DicomHeader& slice, const DicomHeader& first, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(NameOf(slice), " differs from ", NameOf(first),
                                                 " in ", what, ": they are not one volume"));
}

absl::Status CheckAlike(const std::vector<DicomHeader>& slices) {
  const DicomHeader& first = slices.front();
  for (const DicomHeader& slice : slices) {
    if (slice.rows != first.rows || slice.columns != first.columns) {
      return Differs(slice, first,
                     absl::StrCat("size (", slice.columns, " x ", slice.rows, " instead of ",
                                  first.columns, " x ", first.rows, ")"));
    }
    if (!HaveSameAxes(slice, first)) {
      return Differs(slice, first, "orientation");
    }
    if (!slice.pixel_spacing_mm->isApprox(*first.pixel_spacing_mm, kSameDirection)) {
      return Differs(slice, first, "pixel spacing");
    }
  }
  return absl::OkStatus();
}

std::pair<double, double> RescaleOf(const DicomHeader& slice) {
  return {slice.rescale_slope.value_or(1), slice.rescale_intercept.value_or(0)};
}

// DICOM states the rescale of each slice, and some exports vary it.
void NoteRescale(DicomStack* stack) {
  std::map<std::pair<double, double>, int> count;
  for (const DicomHeader& slice : stack->slices) ++count[RescaleOf(slice)];
  if (count.size() == 1) return;
  const auto usual = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  double low = usual->first.second;
  double high = low;
  for (const auto& [rescale, slices] : count) {
    low = std::min(low, rescale.second);
    high = std::max(high, rescale.second);
  }
  stack->notes.push_back(absl::StrCat(
      "the rescale differs between the slices: each slice is converted to HU by its own (usually "
      "RescaleIntercept ",
      usual->first.second, " and RescaleSlope ", usual->first.first, ", in ", usual->second, " of ",
      stack->slices.size(), " slices; RescaleIntercept ", low, " to ", high, ")"));
}

absl::Status CheckPlane(const DicomHeader& slice) {
  const Eigen::Vector3d row = slice.axes->col(0);
  const Eigen::Vector3d column = slice.axes->col(1);
  if (std::abs(row.norm() - 1) > kSameDirection || std::abs(column.norm() - 1) > kSameDirection ||
      std::abs(row.dot(column)) > kSameDirection) {
    return absl::InvalidArgumentError(absl::StrCat(
        NameOf(slice), " has an orientation that is not two directions square to each other"));
  }
  const Eigen::Vector2d& spacing = *slice.pixel_spacing_mm;
  if (!(spacing.minCoeff() >= kLeastSpacingMm && spacing.maxCoeff() <= kMaxSpacingMm)) {
    return absl::InvalidArgumentError(
        absl::StrCat(NameOf(slice), " has pixels of ", spacing[1], " x ", spacing[0],
                     " mm; between ", kLeastSpacingMm, " and ", kMaxSpacingMm, " mm are read"));
  }
  return absl::OkStatus();
}

std::string Place(const DicomHeader& slice) {
  const Eigen::Vector3d& position = *slice.position_mm;
  return absl::StrFormat("%s at (%.2f, %.2f, %.2f) mm", NameOf(slice), position[0], position[1],
                         position[2]);
}

// By positions, not by instance numbers or names of files, which scanners count in either
// direction.
void SortAlong(const Eigen::Vector3d& normal, std::vector<DicomHeader>* slices) {
  std::sort(slices->begin(), slices->end(), [&](const DicomHeader& a, const DicomHeader& b) {
    const double height_a = a.position_mm->dot(normal);
    const double height_b = b.position_mm->dot(normal);
    return height_a != height_b ? height_a < height_b : a.file_number < b.file_number;
  });
}

// Where along the normal each slice lies.
std::vector<double> Heights(const std::vector<DicomHeader>& slices, const Eigen::Vector3d& normal) {
  std::vector<double> heights;
  heights.reserve(slices.size());
  for (const DicomHeader& slice : slices) heights.push_back(slice.position_mm->dot(normal));
  return heights;
}

std::vector<double> Gaps(const std::vector<double>& heights) {
  std::vector<double> gaps;
  for (size_t i = 1; i < heights.size(); ++i) gaps.push_back(heights[i] - heights[i - 1]);
  return gaps;
}

// The usual one of some values: one or two missing slices do not move a median, as they would a
// mean.
double UpperMedian(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

absl::Status CheckGaps(const std::vector<DicomHeader>& slices, const std::vector<double>& gaps) {
  for (size_t i = 0; i < gaps.size(); ++i) {
    if (gaps[i] < kSamePositionMm) {
      return absl::InvalidArgumentError(absl::StrCat(
          NameOf(slices[i]), " and ", Place(slices[i + 1]),
          " have the same position, and their headers do not distinguish two scans: keep only the "
          "files of one scan in the folder"));
    }
    if (gaps[i] > kMaxGapMm) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "there is no slice for %.0f mm between %s and %s: leave the files of one scan in the "
          "folder",
          gaps[i], Place(slices[i]), Place(slices[i + 1])));
    }
  }
  return absl::OkStatus();
}

// Each gap may be even within the tolerance and all of them drift: so every slice is held against
// the line from the first to the last, too.
bool IsEven(const std::vector<DicomHeader>& slices, const std::vector<double>& gaps,
            const Eigen::Vector3d& step) {
  const double usual = UpperMedian(gaps);
  for (size_t i = 0; i < slices.size(); ++i) {
    const Eigen::Vector3d expected = *slices.front().position_mm + static_cast<double>(i) * step;
    if ((*slices[i].position_mm - expected).norm() > kPositionToleranceMm) return false;
    if (i > 0 && std::abs(gaps[i - 1] - usual) > kPositionToleranceMm) return false;
  }
  return true;
}

// "; 2 slices are missing between ... and ..." for the first gap that is a multiple of the usual.
std::string MissingSlices(const std::vector<DicomHeader>& slices, const std::vector<double>& gaps) {
  const double usual = UpperMedian(gaps);
  for (size_t i = 0; i < gaps.size(); ++i) {
    const double missing = std::round(gaps[i] / usual) - 1;
    if (missing < 1 || std::abs(gaps[i] - (missing + 1) * usual) > kPositionToleranceMm) continue;
    // Farther on the slices are as far apart as here: that is how they were taken.
    if (i + 1 < gaps.size() && std::abs(gaps[i + 1] - gaps[i]) < kPositionToleranceMm) return "";
    return absl::StrFormat("; %.0f slice%s missing between %s and %s", missing,
                           missing > 1 ? "s are" : " is", Place(slices[i]), Place(slices[i + 1]));
  }
  return "";
}

std::string UnevenNote(const std::vector<DicomHeader>& slices, const std::vector<double>& gaps) {
  const auto [least, most] = std::minmax_element(gaps.begin(), gaps.end());
  return absl::StrFormat(
      "the slices are unevenly spaced, %.2f to %.2f mm apart, usually %.2f mm: values between them "
      "are "
      "interpolated%s",
      *least, *most, UpperMedian(gaps), MissingSlices(slices, gaps));
}

// From one slice to the next, for one mm along the normal: the median, as some may lie beside the
// line of the others.
Eigen::Vector3d UsualSlope(const std::vector<DicomHeader>& slices, const std::vector<double>& gaps,
                           const Eigen::Vector3d& row, const Eigen::Vector3d& column) {
  std::vector<double> along_row;
  std::vector<double> along_column;
  for (size_t i = 0; i < gaps.size(); ++i) {
    const Eigen::Vector3d step = *slices[i + 1].position_mm - *slices[i].position_mm;
    along_row.push_back(step.dot(row) / gaps[i]);
    along_column.push_back(step.dot(column) / gaps[i]);
  }
  return row.cross(column) + UpperMedian(along_row) * row + UpperMedian(along_column) * column;
}

// A tilted gantry stacks slices along a step that is not their normal: the turn about the row.
double TiltDeg(const Eigen::Vector3d& row, const Eigen::Vector3d& normal,
               const Eigen::Vector3d& step) {
  const double angle = std::atan2(row.dot(step.cross(normal)), step.dot(normal)) * 180 / M_PI;
  return std::abs(angle) < kUprightDeg ? 0 : angle;
}

absl::Status CheckStep(const Eigen::Vector3d& step, const Eigen::Vector3d& normal) {
  if (!(step.norm() >= kLeastSpacingMm && step.norm() <= kMaxSpacingMm)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("the slices are %.3f mm apart; between %.2f and %.0f mm are read",
                        step.norm(), kLeastSpacingMm, kMaxSpacingMm));
  }
  const double angle_deg = std::acos(std::min(1.0, step.normalized().dot(normal))) * 180 / M_PI;
  if (angle_deg > kMaxTiltDeg) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the slices are stacked %.1f degrees off their normal, which no gantry tilt explains",
        angle_deg));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ArrangeStack(bool may_lack_rescale, DicomStack* stack) {
  std::vector<DicomHeader>& slices = stack->slices;
  TF_RETURN_IF_ERROR(CheckTags(slices, may_lack_rescale));
  TF_RETURN_IF_ERROR(CheckAlike(slices));
  NoteRescale(stack);
  TF_RETURN_IF_ERROR(CheckPlane(slices.front()));
  if (slices.size() < kLeastSlices) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the series has ", slices.size(), " slices; a volume needs at least ", kLeastSlices));
  }
  const Eigen::Vector3d row = Eigen::Vector3d(slices.front().axes->col(0)).normalized();
  const Eigen::Vector3d column = Eigen::Vector3d(slices.front().axes->col(1)).normalized();
  const Eigen::Vector3d normal = row.cross(column);
  SortAlong(normal, &slices);
  const std::vector<double> gaps = Gaps(Heights(slices, normal));
  Eigen::Vector3d step = (*slices.back().position_mm - *slices.front().position_mm) /
                         static_cast<double>(slices.size() - 1);
  TF_RETURN_IF_ERROR(CheckGaps(slices, gaps));
  if (!IsEven(slices, gaps, step)) {
    step = UpperMedian(gaps) * UsualSlope(slices, gaps, row, column);
    for (const DicomHeader& slice : slices) stack->slice_origins_mm.push_back(*slice.position_mm);
    stack->notes.push_back(UnevenNote(slices, gaps));
  }
  TF_RETURN_IF_ERROR(CheckStep(step, normal));
  const Eigen::Vector2d& pixel = *slices.front().pixel_spacing_mm;
  stack->spacing_mm = {pixel[1], pixel[0], step.norm()};
  stack->direction << row, column, step.normalized();
  stack->gantry_tilt_deg = TiltDeg(row, normal, step);
  return absl::OkStatus();
}

}  // namespace tissueform
