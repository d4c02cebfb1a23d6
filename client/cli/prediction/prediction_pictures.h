// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/head_frame.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/predicted_case.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What is drawn.
struct BeforeAndAfter {
  TriangleIndices skin;
  Positions rest;                       // of the vertices of `skin`, LPS
  Positions deformed;                   // the same after
  std::vector<SurfaceLayer> bone = {};  // after, and what else is to be seen with it
  HeadFrame head_frame = {};            // what "front" and "left" are by
  std::string move = {};                // for the titles: "mandible 8 mm forward"
  bool is_face = false;                 // whether the views bear the words of a face
};

// The names of the pictures: front.png, left.png, three_quarter.png.
std::vector<std::string> BeforeAndAfterPictures();

// The skin of a case, its bone and teeth, and how far its segments went.
//
// Errors: InvalidArgument: the case shows no skin.
absl::StatusOr<BeforeAndAfter> BeforeAndAfterOfCase(const CaseFile& contents,
                                                    const PredictedCase& predicted,
                                                    const std::map<std::string, HandlePose>& poses);

// The skin before beside the skin after, which is coloured by how far it moved: one picture for
// each view, all with one colour bar, in `folder`. With bone the skin after is not coloured, and a
// second row of panels shows how far it moved, and the bone after: 1024 by 1024 pixels. Needs an X
// display (VirtualDisplay).
//
// Errors: those of Figure::WritePng.
absl::Status DrawBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder);

// The same into a folder that is empty or not there yet, all or nothing. Errors: also those of
// AtomicFolder.
absl::Status WriteBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder);

}  // namespace tissueform
