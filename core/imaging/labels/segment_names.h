// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/imaging/labels/label_map.h"

namespace tissueform {

// What a file says of a segment.
struct SegmentFacts {
  std::string name;
  struct Code {
    std::string scheme;
    std::string value;
    std::string meaning;
  };
  std::vector<Code> codes;  // what it is first, then where it lies
};

// The first 40 characters without what is not printable, for messages and reports.
std::string PrintableName(absl::string_view name);

// Whether a segment of that name has a structure: by `options.names`, or by its name.
bool IsKnownName(const LabelReadOptions& options, absl::string_view name);

// "3 (lower jaw), 4 (b) and 17 more".
std::string NamesOf(const std::vector<const LabelSegment*>& segments);

// Sets `structure` and `side` of each segment from its facts by the order that ReadLabelMap states.
// `facts` are those of the segments, one each. `voxel_mm3` is the volume of a voxel. Appends what
// was assumed and ignored to `notes`.
//
// Errors: InvalidArgument when no voxel is labelled, no segment is known, numbers fit several
// conventions, a rule of the recipe meets no segment, or left and right are swapped.
absl::Status AssignStructures(const LabelReadOptions& options,
                              const std::vector<SegmentFacts>& facts, double voxel_mm3,
                              std::vector<LabelSegment>* segments, std::vector<std::string>* notes);

}  // namespace tissueform
