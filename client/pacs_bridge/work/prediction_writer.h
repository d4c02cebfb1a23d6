// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "client/pacs_bridge/work/object_writer.h"

namespace tissueform {

// The writer of client/pacs_bridge/objects: models, capture and report. Pictures are drawn by
// `tissueform case render`, a child; where there is no display for it, the capture is refused.
// `device_serial` names this bridge in what it writes; drawing ends with Cancelled when the
// descriptor `cancel` (-1: none) becomes readable.
std::unique_ptr<ObjectWriter> MakePredictionWriter(const std::string& device_serial, int cancel);

}  // namespace tissueform
