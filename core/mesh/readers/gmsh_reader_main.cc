// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-gmsh-reader: reads a mesh through Gmsh for another program of ours.

#include "core/mesh/readers/gmsh_model.h"
#include "core/mesh/readers/mesh_reader_call.h"

int main() {
  return tissueform::RunMeshReader([](const tissueform::CheckedMeshFile& file) {
    return tissueform::ReadGmshModel(file.path, file.format == tissueform::MeshFormat::kMedit);
  });
}
