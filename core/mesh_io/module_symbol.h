// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

namespace tissueform {

// What the module (a shared object beside the program) exports by that name. Libraries that only
// some files need live in modules: looking up their symbols at every start would take longer than
// most commands. The module stays loaded. Internal to core/mesh_io.
//
// Errors: NotFound when there is no such module, Internal when it is of another version.
absl::StatusOr<void*> ModuleSymbol(const char* module, const char* symbol);

}  // namespace tissueform
