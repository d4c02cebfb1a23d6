// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/objects/common_modules.h"

namespace tissueform {

// Of one picture, each way.
inline constexpr uint32_t kMaxPicturePixels = 2048;

// Pictures of one size, one after the other: 3 bytes a pixel (red, green, blue), row by row from
// the top.
struct CaptureFrames {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<uint8_t> rgb = {};
};

// Errors: NotFound, InvalidArgument: no PNG, larger than kMaxPicturePixels, or not of the first
// one's size; with the path.
absl::StatusOr<CaptureFrames> ReadCaptureFrames(const std::vector<std::string>& paths);

// The modules of a multi-frame true colour secondary capture, uncompressed, into an object with
// the common ones: one frame a picture.
//
// Errors: those of ReadCaptureFrames; Internal, with the tag.
absl::Status WriteCaptureModules(const PredictionObjectsInput& input, DcmDataset* object);

}  // namespace tissueform
