// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_frames.h"

#include <gdcmDataSet.h>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <Eigen/Geometry>

#include "core/imaging/ct/dicom_tags.h"

namespace tissueform {
namespace {

constexpr uint32_t kSharedGroups = 0x52009229;
constexpr uint32_t kGroupsOfFrames = 0x52009230;
constexpr uint32_t kNumberOfFrames = 0x00280008;
constexpr uint32_t kSliceThickness = 0x00180050;
constexpr uint32_t kSpacingBetweenSlices = 0x00180088;
constexpr int kMaxFrames = 65535;  // of one file: more than any scanner writes

// The macros of the functional groups that matter, and what stands in them.
constexpr uint32_t kPlanePosition = 0x00209113;
constexpr uint32_t kPosition = 0x00200032;
constexpr uint32_t kPlaneOrientation = 0x00209116;
constexpr uint32_t kOrientation = 0x00200037;
constexpr uint32_t kPixelMeasures = 0x00289110;
constexpr uint32_t kPixelSpacing = 0x00280030;
constexpr uint32_t kValueTransformation = 0x00289145;
constexpr uint32_t kRescaleIntercept = 0x00281052;
constexpr uint32_t kRescaleSlope = 0x00281053;
constexpr uint32_t kFrameContent = 0x00209111;
constexpr uint32_t kFrameAcquisitionTime = 0x00189074;
constexpr uint32_t kFrameAcquisitionNumber = 0x00209156;
constexpr uint32_t kTemporalPosition = 0x00209128;
constexpr uint32_t kFrameTypes = 0x00189329;
constexpr uint32_t kFrameType = 0x00089007;
constexpr uint32_t kReconstruction = 0x00189314;
constexpr uint32_t kKernel = 0x00181210;

void ReadGeometry(const gdcm::DataSet& groups, DicomHeader* frame) {
  ForEachItem(groups, kPlanePosition, [frame](int /*index*/, const gdcm::DataSet& item) {
    if (const auto position = NumbersOf(item, kPosition, 3)) frame->position_mm = *position;
  });
  ForEachItem(groups, kPlaneOrientation, [frame](int /*index*/, const gdcm::DataSet& item) {
    const auto directions = NumbersOf(item, kOrientation, 6);
    if (!directions) return;
    frame->axes.emplace() << directions->head<3>(), directions->tail<3>();
  });
  ForEachItem(groups, kPixelMeasures, [frame](int /*index*/, const gdcm::DataSet& item) {
    if (const auto spacing = NumbersOf(item, kPixelSpacing, 2)) frame->pixel_spacing_mm = *spacing;
  });
}

void ReadValuesAndKind(const gdcm::DataSet& groups, DicomHeader* frame) {
  ForEachItem(groups, kValueTransformation, [frame](int /*index*/, const gdcm::DataSet& item) {
    frame->rescale_intercept = NumberOf(item, kRescaleIntercept);
    frame->rescale_slope = NumberOf(item, kRescaleSlope);
  });
  ForEachItem(groups, kFrameContent, [frame](int /*index*/, const gdcm::DataSet& item) {
    frame->acquisition_time_s = SecondsOf(item, kFrameAcquisitionTime);
    // A US here, where AcquisitionNumber of a slice is text; scanners count from 1.
    if (const int number = ShortOf(item, kFrameAcquisitionNumber); number > 0) {
      frame->acquisition_number = number;
    }
    absl::StrAppend(&frame->reconstruction, "|", ShortOf(item, kTemporalPosition));
  });
  ForEachItem(groups, kFrameTypes, [frame](int /*index*/, const gdcm::DataSet& item) {
    if (absl::StrContains(TextOf(item, kFrameType), "LOCALIZER")) {
      frame->kind = DicomKind::kLocaliser;
    }
  });
  ForEachItem(groups, kReconstruction, [frame](int /*index*/, const gdcm::DataSet& item) {
    absl::StrAppend(&frame->reconstruction, "|", TextOf(item, kKernel));
  });
}

// Cone-beam devices write a whole volume into the plain CT class: position, orientation and spacing
// of the first frame at the top level, and the frames follow along the normal.
std::vector<DicomHeader> EvenFrames(const gdcm::DataSet& data, const DicomHeader& file) {
  const int count = IntegerOf(data, kNumberOfFrames).value_or(0);
  std::optional<double> spacing_mm = NumberOf(data, kSpacingBetweenSlices);
  if (!spacing_mm) spacing_mm = NumberOf(data, kSliceThickness);
  if ((!file.class_uid.empty() && file.class_uid != kCtImageClass) || count < 2 ||
      count > kMaxFrames || !file.position_mm || !file.axes || !spacing_mm || *spacing_mm == 0) {
    return {};
  }
  DicomHeader frame = file;
  frame.kind = DicomKind::kCtSlice;
  frame.num_frames = count;
  frame.even_frames = true;
  const Eigen::Vector3d step_mm = *spacing_mm * SliceNormal(file).normalized();
  std::vector<DicomHeader> frames(static_cast<size_t>(count), frame);
  for (int i = 0; i < count; ++i) {
    frames[static_cast<size_t>(i)].frame = i;
    *frames[static_cast<size_t>(i)].position_mm += i * step_mm;
  }
  return frames;
}

void ReadGroups(const gdcm::DataSet& groups, DicomHeader* frame) {
  ReadGeometry(groups, frame);
  ReadValuesAndKind(groups, frame);
}

}  // namespace

std::vector<DicomHeader> FramesOf(const gdcm::DataSet& data, const DicomHeader& file) {
  DicomHeader common = file;
  common.kind = DicomKind::kCtSlice;
  ForEachItem(data, kSharedGroups, [&common](int /*index*/, const gdcm::DataSet& groups) {
    ReadGroups(groups, &common);
  });
  std::vector<DicomHeader> frames;
  const int count = ForEachItem(data, kGroupsOfFrames, [&](int index, const gdcm::DataSet& groups) {
    DicomHeader frame = common;
    frame.frame = index;
    ReadGroups(groups, &frame);
    frames.push_back(std::move(frame));
  });
  if (count == 0) return EvenFrames(data, file);
  // More or fewer groups than frames: it is unknown which position belongs to which frame.
  if (IntegerOf(data, kNumberOfFrames) != count) return {};
  for (DicomHeader& frame : frames) frame.num_frames = count;
  return frames;
}

}  // namespace tissueform
