// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/planning/case_file/case_file.h"

namespace tissueform {

// What a file that moves holds before it is compressed (docs/moving-file.md). No name, date or
// identifier: of a case only what is here is taken.
struct MovingData {
  std::string title = {};     // empty unless the user gave one
  std::string software = {};  // "tissueform 0.2.0"
  std::string model = {};     // by its name in plans
  HeadFrame head_frame = {};
  std::vector<CaseHandle> handles = {};
  std::vector<bool> handle_is_free = {};  // has sliders; the others stay in the plan's pose
  // FollowedVertices::vertices are rows of the answers. Regions are not written.
  std::vector<CaseSurface> surfaces = {};
  std::string answers = {};  // as docs/prepared-answers.md has them
};

// The vertices of the mesh that surfaces follow, rising; what the surfaces follow becomes places
// among them.
std::vector<int32_t> FollowedVerticesOf(std::vector<CaseSurface>* surfaces);

// The bytes: little-endian, positions rounded to 1/2048 mm, weights to 1/65535. The planner writes
// the same (client/web/src/movingdata).
//
// REQUIRES: positions within 1e6 mm.
std::string WriteMovingData(const MovingData& data);

}  // namespace tissueform
