// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// OK when there are vertices and cells, every cell names vertices that are there, and every array
// has its length, a name that can be written again and no namesake. Otherwise InvalidArgument,
// without the name of the file. Internal to core/mesh/io.
absl::Status CheckRawMesh(const RawMesh& mesh);

// "cannot read mesh PATH: " before the message of an error.
absl::Status WithMeshName(const std::string& path, const absl::Status& error);

}  // namespace tissueform
