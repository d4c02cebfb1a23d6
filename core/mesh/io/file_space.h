// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// The coordinate system that the file of a surface states.
enum class FileSpace { kUnstated, kLps, kRas };

// What "SPACE=RAS" or "SPACE=LPS" says in the header of an .stl file or in a comment at the start
// of a .ply or .obj file, where 3D Slicer writes it. Other formats state nothing.
FileSpace SpaceOf(const CheckedMeshFile& file);

// Turns a mesh from RAS to LPS: x and y change their signs, of the normals too.
void TurnRasToLps(RawMesh* mesh);

}  // namespace tissueform
