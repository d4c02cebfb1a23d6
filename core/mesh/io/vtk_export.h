// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>
#include <vtkPointSet.h>
#include <vtkXMLWriter.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"
#include "core/mesh/io/triangle_mesh_io.h"

namespace tissueform {

// What the writers of VTK's XML formats share. Internal to core/mesh/io.

// OK when every array has `num_tuples` tuples and a legal name of its own.
absl::Status CheckAttributes(const std::vector<Attribute>& attributes, Eigen::Index num_tuples);

// Gives `data` the points, the arrays and the field "notice": one byte for each letter.
void AddPointsAndArrays(const Positions& positions, const std::vector<Attribute>& point_data,
                        const std::vector<Attribute>& cell_data, vtkPointSet* data);

// The whole file as a text: XML with the arrays at its end, in base64 and compressed by zlib, and
// the notice once more as a comment. The disk is touched in one place only, which is not VTK's.
absl::StatusOr<std::string> SerializeWith(vtkXMLWriter* writer, vtkPointSet* data);

// The surface with its arrays and the notice as the contents of a .vtp file. InvalidArgument for an
// array of the wrong length or with an illegal name.
absl::StatusOr<std::string> VtpText(const TriangleMeshFile& file);

}  // namespace tissueform
