// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vtkImageData.h>

#include "absl/status/statusor.h"

namespace tissueform {

// An 8-bit RGB picture as a PNG of the 256 colours that suit it best: a third of the size, for
// pictures that are kept with their text. Internal when the library refuses.
absl::StatusOr<std::string> EncodeIndexedPng(vtkImageData* picture);

}  // namespace tissueform
