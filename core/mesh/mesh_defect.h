// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"

namespace tissueform {

// How bad a defect is.
enum class Severity {
  kWarning,  // usable: what it means is said
  kError,    // not usable by a deformer
};

// One kind of defect that a mesh has.
struct MeshDefect {
  std::string_view kind;  // "inverted_tets", "duplicate_tets", ...; fixed names, used in JSON
  Severity severity = Severity::kError;
  Eigen::Index count = 0;
  std::vector<Eigen::Index> examples;  // up to kMaxExamples vertices or cells, rising
  std::string explanation;             // one line: what, where, what to do

  static constexpr size_t kMaxExamples = 5;
};

// What one kind of defect is called, apart from where it is.
struct DefectWords {
  std::string_view kind;
  Severity severity = Severity::kError;
  absl::string_view what;    // "tets have negative volume"
  absl::string_view noun;    // of the examples: "tet"
  absl::string_view advice;  // "remesh"
};

// Adds "<count> <what> (<noun> <examples>): <advice>" when `found`, in rising order, is not empty.
void AddDefect(const DefectWords& words, const std::vector<Eigen::Index>& found,
               std::vector<MeshDefect>* defects);

// The diagonals of bounding boxes, in mm, that a head or a part of it may have. What has another
// one was probably saved in another unit.
inline constexpr double kLeastHeadDiagonalMm = 10;
inline constexpr double kMaxHeadDiagonalMm = 2000;

// The warning implausible_size for places, in mm, whose bounding box cannot be that of a head;
// nothing where it may be one, or where a coordinate is not finite.
std::optional<MeshDefect> FindImplausibleSize(const Positions& positions);
// Adds it where there is one.
void AddImplausibleSize(const Positions& positions, std::vector<MeshDefect>* defects);

// Whether no defect is of Severity::kError.
bool AreUsable(const std::vector<MeshDefect>& defects);

// The defect of that kind, or null.
const MeshDefect* FindDefect(const std::vector<MeshDefect>& defects, std::string_view kind);

// OK when they are usable, otherwise InvalidArgument with the first error's explanation and the
// number of further ones.
absl::Status CheckDefects(const std::vector<MeshDefect>& defects);

}  // namespace tissueform
