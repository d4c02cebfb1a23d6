// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <dlfcn.h>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"

#include "core/mesh_io/gmsh_model.h"

namespace tissueform {
namespace {

absl::StatusOr<GmshModelFunction> LoadModule() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::string module = (program.parent_path() / kGmshModule).string();
  // Never closed: the process ends with the mesh.
  void* const handle = dlopen(module.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    return absl::NotFoundError(
        absl::StrCat("cannot load ", module, " (", dlerror(), "); install it beside the program"));
  }
  const auto function = reinterpret_cast<GmshModelFunction>(dlsym(handle, kGmshModelSymbol));
  if (function == nullptr) {
    return absl::InternalError(absl::StrCat(module, " is of another version"));
  }
  return function;
}

}  // namespace

absl::StatusOr<RawMesh> ReadGmshModel(const std::string& path, bool is_medit) {
  const absl::StatusOr<GmshModelFunction> read = LoadModule();
  if (!read.ok()) return read.status();
  absl::StatusOr<RawMesh> mesh;
  (*read)(path, is_medit, &mesh);
  return mesh;
}

}  // namespace tissueform
