// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// What is drawn.
struct BeforeAndAfter {
  const TetMesh& mesh;
  const Positions& deformed;  // #V by 3, LPS
  std::string move;           // for the titles: "mandible 8 mm forward"
  bool is_face = false;       // whether the views bear the words of a face
};

// The names of the pictures: front.png, left.png, three_quarter.png.
std::vector<std::string> BeforeAndAfterPictures();

// The skin before beside the skin after, which is coloured by how far it moved: one picture for
// each view, all with one colour bar, in `folder`. Needs an X display (VirtualDisplay).
//
// Errors: those of Figure::WritePng.
absl::Status DrawBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder);

}  // namespace tissueform
