// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/anatomy/plane.h"

namespace tissueform {

struct MarkupPoint {
  std::string label;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // LPS
};

// One entry of a 3D Slicer markups file. Texts are untrusted and may name a patient.
struct Markup {
  std::string type;  // "Fiducial", "Curve", "Plane", ...
  std::string name;
  std::vector<MarkupPoint> points;  // those with a position, in their order
  // Of entries of type "Plane", and of others with three points or more that are not on one line:
  // through the points, as well as it fits. LPS, mm; the normal has length 1.
  std::optional<Plane> plane;
};

// Parses the text of a markups file (.mrk.json). RAS and micrometers are turned to LPS and mm.
//
// Errors: InvalidArgument when the text is not such a file, has no entry, or states axes or units
// that are not known; the message quotes nothing of the file.
absl::StatusOr<std::vector<Markup>> ParseMarkups(const std::string& text);

// The same for a file. Errors: also those of ReadJsonText.
absl::StatusOr<std::vector<Markup>> ReadMarkups(const std::string& path);

}  // namespace tissueform
