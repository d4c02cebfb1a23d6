// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_split.h"
#include <Eigen/LU>

#include "core/imaging/labels/label_facts.h"
#include "core/imaging/labels/seg_frames.h"
#include "core/imaging/labels/segment_names.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

void Require(bool promise) {
  if (!promise) std::abort();
}

// A message is one line of printable text for all names.
void CheckText(absl::string_view text) {
  for (const char letter : text) Require(letter >= 32 && letter < 127);
}

void CheckNames(const FactsByLabel& facts_by_label) {
  std::vector<SegmentFacts> facts;
  std::vector<LabelSegment> segments;
  for (const auto& [label, entry] : facts_by_label) {
    LabelSegment segment;
    segment.name = PrintableName(entry.name);
    segment.layer = label.first;
    segment.value = std::clamp(label.second, 1, 65535);
    segment.voxels = 1 + label.second % 7 * (label.second % 7);
    segment.middle_mm.x() = label.second;
    segments.push_back(segment);
    facts.push_back(entry);
  }
  std::vector<std::string> notes;
  const absl::Status status = AssignStructures({}, facts, 1, &segments, &notes);
  CheckText(status.message());
  for (const std::string& note : notes) CheckText(note);
}

// "key=value" a line, as a NRRD has key and value pairs.
std::map<std::string, std::string> TextsOf(absl::string_view text) {
  std::map<std::string, std::string> texts;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(line, absl::MaxSplits('=', 1));
    texts[pair.first] = pair.second;
  }
  return texts;
}

double FiniteNumber(ByteSource* source) {
  if (source->Take<uint8_t>() % 4 != 0) return source->Take<int8_t>();
  const auto number = source->Take<double>();
  return std::isfinite(number) ? number : 0;  // as NumbersOf
}

void CheckFrames(ByteSource* source) {
  Eigen::Vector3d row = Eigen::Vector3d::UnitX();
  if (source->Take<uint8_t>() % 8 == 0) row.y() = FiniteNumber(source);
  const double step_mm = FiniteNumber(source);
  const Eigen::Vector2d spacing_mm(FiniteNumber(source), 1);
  SegGrid grid;
  while (grid.frames.size() < 64 && (source->left() > 0 || grid.frames.empty())) {
    SegFrame frame;
    frame.position_mm.z() = FiniteNumber(source);
    if (source->Take<uint8_t>() % 8 == 0) frame.position_mm.x() = FiniteNumber(source);
    grid.frames.push_back(frame);
  }
  if (!ArrangeSegFrames(row, Eigen::Vector3d::UnitY(), spacing_mm, step_mm, &grid).ok()) return;
  Require(grid.steps_mm.allFinite() && std::abs(grid.steps_mm.determinant()) > 0);
  for (const SegFrame& frame : grid.frames) {
    Require(frame.slice >= 0 && frame.slice < grid.size[2]);
    const Eigen::Vector3d place = grid.origin_mm + frame.slice * grid.steps_mm.col(2);
    Require((place - frame.position_mm).norm() <= std::max(1.0, grid.steps_mm.col(2).norm()));
  }
}

}  // namespace

// The file itself is ITK's or GDCM's to read, in a helper program; what comes of it is ours.
void FuzzLabels(const uint8_t* data, size_t size) {
  if (size == 0) return;
  const absl::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] % 3 == 0) CheckNames(FactsOfNifti(text));
  if (data[0] % 3 == 1) CheckNames(FactsOfNrrd(TextsOf(text)));
  ByteSource source(data + 1, size - 1);
  if (data[0] % 3 == 2) CheckFrames(&source);
}

}  // namespace tissueform::fuzz
