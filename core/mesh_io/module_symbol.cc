// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/module_symbol.h"

#include <dlfcn.h>
#include <filesystem>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace tissueform {

absl::StatusOr<void*> ModuleSymbol(const char* module, const char* symbol) {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::string path = (program.parent_path() / module).string();
  // Never closed: what it made lives as long as the process.
  void* const handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    return absl::NotFoundError(
        absl::StrCat("cannot load ", path, " (", dlerror(), "); install it beside the program"));
  }
  void* const found = dlsym(handle, symbol);
  if (found == nullptr) {
    return absl::InternalError(absl::StrCat(path, " is of another version"));
  }
  return found;
}

}  // namespace tissueform
