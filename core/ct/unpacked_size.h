// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/strings/string_view.h"

namespace tissueform {

// How many bytes the streams of gzip or zlib in `packed` hold, one after the other; 0 where they
// are cut off or damaged. Stops counting soon after `enough`. ITK's readers of NIfTI and MetaImage
// pass over what is missing. Internal to core/ct.
int64_t UnpackedSize(absl::string_view packed, int64_t enough);

// Whether they begin as gzip does.
bool IsGzip(absl::string_view bytes);

}  // namespace tissueform
