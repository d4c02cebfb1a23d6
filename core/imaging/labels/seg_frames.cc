// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/seg_frames.h"

#include <algorithm>
#include <cmath>
#include <gdcmDataSet.h>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/ct/dicom_tags.h"

namespace tissueform {
namespace {

constexpr uint32_t kRows = 0x00280010;
constexpr uint32_t kColumns = 0x00280011;
constexpr uint32_t kPosition = 0x00200032;
constexpr uint32_t kOrientation = 0x00200037;
constexpr uint32_t kPixelSpacing = 0x00280030;
constexpr uint32_t kSliceThickness = 0x00180050;
constexpr uint32_t kSpacingBetweenSlices = 0x00180088;
constexpr uint32_t kSharedGroups = 0x52009229;
constexpr uint32_t kGroupsOfFrames = 0x52009230;
constexpr uint32_t kPlanePosition = 0x00209113;
constexpr uint32_t kPlaneOrientation = 0x00209116;
constexpr uint32_t kPixelMeasures = 0x00289110;
constexpr uint32_t kSegmentIdentification = 0x0062000a;
constexpr uint32_t kReferencedSegment = 0x0062000b;
constexpr uint32_t kSegmentationType = 0x00620001;

constexpr double kSamePlaceMm = 0.02;
constexpr double kOffStepShare = 0.1;  // of a step, that a slice may lie beside its place
constexpr int kMaxSlices = 20000;
constexpr double kFarthestMm = 1e5;  // of a frame from the origin
constexpr double kMaxSpacingMm = 100;

// What the functional groups of a frame, or the shared ones, say.
struct Groups {
  std::optional<Eigen::VectorXd> position;
  std::optional<Eigen::VectorXd> orientation;
  std::optional<Eigen::VectorXd> pixel_spacing;
  std::optional<double> step_mm;
  int segment = 0;
};

// Overwrites what the item states, so that a frame's own groups go before the shared ones.
void TakeGroups(const gdcm::DataSet& item, Groups* groups) {
  ForEachItem(item, kPlanePosition, [&](int, const gdcm::DataSet& group) {
    groups->position = NumbersOf(group, kPosition, 3);
  });
  ForEachItem(item, kPlaneOrientation, [&](int, const gdcm::DataSet& group) {
    groups->orientation = NumbersOf(group, kOrientation, 6);
  });
  ForEachItem(item, kPixelMeasures, [&](int, const gdcm::DataSet& group) {
    groups->pixel_spacing = NumbersOf(group, kPixelSpacing, 2);
    groups->step_mm = NumberOf(group, kSpacingBetweenSlices);
    if (!groups->step_mm) groups->step_mm = NumberOf(group, kSliceThickness);
  });
  ForEachItem(item, kSegmentIdentification, [&](int, const gdcm::DataSet& group) {
    groups->segment = ShortOf(group, kReferencedSegment);
  });
}

absl::Status CheckGroups(const Groups& groups, bool needs_segment, int frame) {
  const char* const missing = !groups.position                       ? "position"
                              : !groups.orientation                  ? "orientation"
                              : !groups.pixel_spacing                ? "pixel spacing"
                              : needs_segment && groups.segment == 0 ? "segment"
                                                                     : nullptr;
  if (missing == nullptr) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("frame ", frame + 1, " of the SEG has no ", missing, "; export it again"));
}

absl::Status NotOneVolume(absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat("the frames of the SEG are not the slices of one volume: ", why,
                   "; export it again, one volume a file"));
}

std::vector<double> HeightsOf(const std::vector<SegFrame>& frames, const Eigen::Vector3d& normal) {
  std::vector<double> heights;
  heights.reserve(frames.size());
  for (const SegFrame& frame : frames) heights.push_back(frame.position_mm.dot(normal));
  std::sort(heights.begin(), heights.end());
  heights.erase(std::unique(heights.begin(), heights.end(),
                            [](double a, double b) { return std::abs(a - b) < kSamePlaceMm; }),
                heights.end());
  return heights;
}

// The smallest distance of two slices, unless all are whole multiples of the stated one.
double StepOf(const std::vector<double>& heights, double stated_mm) {
  double smallest = 0;
  bool multiples = stated_mm > kSamePlaceMm;
  for (size_t i = 1; i < heights.size(); ++i) {
    const double step = heights[i] - heights[i - 1];
    smallest = i == 1 ? step : std::min(smallest, step);
    multiples = multiples && std::abs(step - stated_mm * std::round(step / stated_mm)) <
                                 kOffStepShare * stated_mm;
  }
  return multiples ? stated_mm : smallest;
}

}  // namespace

absl::Status ArrangeSegFrames(const Eigen::Vector3d& row_direction,
                              const Eigen::Vector3d& column_direction,
                              const Eigen::Vector2d& pixel_spacing_mm, double step_mm,
                              SegGrid* grid) {
  const Eigen::Vector3d normal = row_direction.cross(column_direction);
  const bool is_square = std::abs(row_direction.norm() - 1) < 1e-2 &&
                         std::abs(column_direction.norm() - 1) < 1e-2 &&
                         std::abs(normal.norm() - 1) < 1e-2;
  if (!is_square) return NotOneVolume("rows and columns are not square to each other");
  if (!(pixel_spacing_mm.minCoeff() > 0 && pixel_spacing_mm.maxCoeff() <= kMaxSpacingMm)) {
    return NotOneVolume(
        absl::StrCat("pixels have no spacing, or more than ", kMaxSpacingMm, " mm"));
  }
  for (const SegFrame& frame : grid->frames) {
    if (!(frame.position_mm.cwiseAbs().maxCoeff() <= kFarthestMm)) {
      return NotOneVolume("a frame is farther than 100 m from the origin");
    }
  }
  const std::vector<double> heights = HeightsOf(grid->frames, normal);
  const double step = StepOf(heights, step_mm);
  if (!(step > kSamePlaceMm && step <= kMaxSpacingMm)) {
    return NotOneVolume("slices have no distance between them, or more than 100 mm");
  }
  const double slices = std::round((heights.back() - heights.front()) / step) + 1;
  if (!(slices <= kMaxSlices)) return NotOneVolume("its slices are too far apart");
  const auto [lowest, highest] = std::ranges::minmax_element(
      grid->frames, {}, [&](const SegFrame& frame) { return frame.position_mm.dot(normal); });
  grid->origin_mm = lowest->position_mm;
  // Sheared where a gantry was tilted.
  const Eigen::Vector3d along =
      slices > 1 ? Eigen::Vector3d((highest->position_mm - lowest->position_mm) / (slices - 1))
                 : Eigen::Vector3d(step * normal);
  // DICOM's pixel spacing is that of rows first: along a column.
  grid->steps_mm << pixel_spacing_mm[1] * row_direction, pixel_spacing_mm[0] * column_direction,
      along;
  grid->size[2] = static_cast<int>(slices);
  for (SegFrame& frame : grid->frames) {
    const double height = (frame.position_mm - grid->origin_mm).dot(normal);
    frame.slice = std::clamp(static_cast<int>(std::lround(height / step)), 0, grid->size[2] - 1);
    const Eigen::Vector3d place = grid->origin_mm + frame.slice * along;
    if ((frame.position_mm - place).norm() > kOffStepShare * std::max(step, 1.0)) {
      return NotOneVolume(absl::StrFormat("a frame lies %.2f mm beside its place",
                                          (frame.position_mm - place).norm()));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<SegGrid> PlaceSegFrames(const gdcm::DataSet& data, int64_t max_voxels) {
  SegGrid grid;
  grid.size = {ShortOf(data, kColumns), ShortOf(data, kRows), 0};
  Groups shared;
  ForEachItem(data, kSharedGroups,
              [&](int, const gdcm::DataSet& item) { TakeGroups(item, &shared); });
  const bool needs_segment = TextOf(data, kSegmentationType) != "LABELMAP";
  absl::Status status;
  Groups first = shared;
  ForEachItem(data, kGroupsOfFrames, [&](int frame, const gdcm::DataSet& item) {
    Groups groups = shared;
    TakeGroups(item, &groups);
    if (status.ok()) status = CheckGroups(groups, needs_segment, frame);
    if (!status.ok()) return;
    if (frame == 0) first = groups;
    if ((*groups.orientation - *first.orientation).norm() > 1e-3) {
      status = NotOneVolume("their orientations differ");
    }
    grid.frames.push_back({groups.segment, *groups.position, 0});
  });
  TF_RETURN_IF_ERROR(status);
  if (grid.frames.empty() || grid.size[0] < 1 || grid.size[1] < 1) {
    return absl::InvalidArgumentError("the SEG has no frames; export it again");
  }
  TF_RETURN_IF_ERROR(ArrangeSegFrames(first.orientation->head<3>(), first.orientation->tail<3>(),
                                      *first.pixel_spacing, first.step_mm.value_or(0), &grid));
  const int64_t voxels = int64_t{grid.size[0]} * grid.size[1] * grid.size[2];
  if (voxels <= max_voxels) return grid;
  return absl::ResourceExhaustedError(
      absl::StrCat("the volume has ", voxels, " voxels; at most ", max_voxels, " are read"));
}

}  // namespace tissueform
