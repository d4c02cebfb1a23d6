// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/segment_files.h"

namespace tissueform {

// What the files say that a recipe's segments name. Vectors have one entry for each segment.
struct SegmentFiles {
  std::vector<std::optional<TriangleMesh>> pieces;  // LPS, mm; all segments have one, or none has
  std::vector<std::optional<FileMove>> moves;
  SurfaceAxes axes;
  std::vector<std::string> notes;  // on unit and axes, one sentence each
};

// Reads the surfaces and transforms of a recipe's segments; does nothing if it names no such files.
//
// Errors: those of ReadMove and SurfaceReader::Read, with the segment's name.
absl::StatusOr<SegmentFiles> ReadSegmentFiles(const Recipe& recipe, int threads);

// Marks given pieces among the bone of a CT: labels as of CutSegments (0 no bone, 1 bone that
// stays, 2.. the segments), or nothing where the segments are to be cut. A piece is what its
// surface encloses, with openings closed, and the bone of the same jaw that lies outside it by at
// most 2 mm and has no other bone behind it: surfaces are smoothed, and a shell of bone that stays
// would hold the tissue. Adds what pieces enclose to the head's bone and to the part that most of
// the piece belongs to. Adds notes, one sentence each.
//
// Errors: InvalidArgument when less than 70 % of a surface lies on the CT's bone, with the axes or
// the unit in which it does; when a surface faces inward or encloses nothing, or pieces overlap.
absl::StatusOr<std::optional<LabelGrid>> PlacePieces(const SegmentFiles& files, int threads,
                                                     Recipe* recipe, HeadSegmentation* head,
                                                     BoneParts* parts,
                                                     std::vector<std::string>* notes);

// Sets the poses of segments whose movement files give, with a note on each. The pivot is the
// middle of a given piece; of a piece that is cut it is the incisor, of a chin the pogonion.
void ResolveMoves(const SegmentFiles& files, const Landmarks& landmarks, Recipe* recipe,
                  std::vector<std::string>* notes);

}  // namespace tissueform
