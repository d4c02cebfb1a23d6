// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/image_header.h"

#include "absl/strings/match.h"
#include <Eigen/Geometry>

namespace tissueform {

bool IsCtClass(absl::string_view class_uid) {
  return class_uid == kCtImageClass || class_uid == kEnhancedCtImageClass ||
         class_uid == kLegacyEnhancedCtImageClass;
}

bool IsLocaliser(const ImageHeader& image) {
  return absl::StrContains(image.image_type, "LOCALIZER") ||
         absl::StrContains(image.image_type, "SCOUT");
}

Eigen::Vector3d SliceNormal(const ImageHeader& image) {
  const Eigen::Vector3d row = image.axes->col(0);
  const Eigen::Vector3d column = image.axes->col(1);
  return row.cross(column);
}

}  // namespace tissueform
