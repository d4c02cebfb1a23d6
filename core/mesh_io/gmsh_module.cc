// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/status_macros.h"
#include "core/mesh_io/gmsh_model.h"
#include "core/mesh_io/module_symbol.h"

namespace tissueform {

absl::StatusOr<RawMesh> ReadGmshModel(const std::string& path, bool is_medit) {
  TF_ASSIGN_OR_RETURN(void* const read, ModuleSymbol(kGmshModule, kGmshModelSymbol));
  absl::StatusOr<RawMesh> mesh;
  reinterpret_cast<GmshModelFunction>(read)(path, is_medit, &mesh);
  return mesh;
}

}  // namespace tissueform
