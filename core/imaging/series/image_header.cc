// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/image_header.h"

namespace tissueform {

bool IsCtClass(absl::string_view class_uid) {
  return class_uid == kCtImageClass || class_uid == kEnhancedCtImageClass ||
         class_uid == kLegacyEnhancedCtImageClass;
}

}  // namespace tissueform
