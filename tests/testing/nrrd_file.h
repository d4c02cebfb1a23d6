// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/imaging/ct/ct_volume.h"

namespace tissueform::testing {

// As NRRD with its place in the patient, values as they are (Hounsfield units or gray values).
absl::Status WriteNrrd(const std::string& path, const CtVolume& volume);

}  // namespace tissueform::testing
