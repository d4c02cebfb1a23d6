// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/process/helper_program.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// The programs that read: VTK, CGAL and TetGen in one; Gmsh, which brings some ninety libraries,
// and VTK's STL, which brings forty, in others, so that loading those does not delay the rest.
inline constexpr char kMeshReaderProgram[] = "tissueform-mesh-reader";
inline constexpr char kStlReaderProgram[] = "tissueform-stl-reader";
inline constexpr char kGmshReaderProgram[] = "tissueform-gmsh-reader";

// Lets a helper program read the file within the limits. Any thread may call it.
//
// Errors: those of the helper's function; InvalidArgument when the helper ended without a result;
// ResourceExhausted when a limit stopped it, or the mesh is larger than the limit of memory;
// NotFound when there is no such program.
absl::StatusOr<RawMesh> CallMeshReader(absl::string_view program, const CheckedMeshFile& file,
                                       const IsolationLimits& limits);

// Inside such a program: main() returns this. Answers with what `read` makes of the file.
int RunMeshReader(const std::function<absl::StatusOr<RawMesh>(const CheckedMeshFile& file)>& read);

}  // namespace tissueform
