// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"

#include "core/planning/rendering/panels.h"

namespace tissueform {

// A picture of labelled panels, (a), (b), ... in rows, under a title and over a line that says that
// this is not a medical device.
class Figure {
 public:
  explicit Figure(std::string title, int width_px = 1600);

  // Panels of one width. All scenes of one row have one scale, so that sizes can be compared.
  void AddRow(int height_px, std::vector<Scene> scenes);
  void AddRow(int height_px, std::vector<Chart> charts);
  void AddRow(int height_px, std::vector<Picture> pictures);

  // Renders offscreen and writes the file all or nothing. Needs an X display (VirtualDisplay).
  //
  // Errors: those of WriteFileAtomically; Internal when VTK makes no picture.
  absl::Status WritePng(const std::string& path) const;

 private:
  struct Row {
    int height_px = 0;
    std::variant<std::vector<Scene>, std::vector<Chart>, std::vector<Picture>> panels;
  };

  std::string title_;
  int width_px_;
  std::vector<Row> rows_;
};

}  // namespace tissueform
