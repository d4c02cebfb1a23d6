// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh_io/triangle_mesh_io.h"

namespace tissueform {

// The surface with its arrays and the notice as the contents of a .vtp file, compressed. Internal
// to core/mesh_io. InvalidArgument for an array of the wrong length or with an illegal name.
absl::StatusOr<std::string> VtpText(const TriangleMeshFile& file);

}  // namespace tissueform
