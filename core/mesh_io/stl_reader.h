// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

class vtkAlgorithm;

namespace tissueform {

// VTK's reader of STL lives in a module of its own (see module_symbol.h): its library brings some
// twenty others. What the module exports, and by which name: a new vtkSTLReader for that file,
// which the caller owns. Internal to core/mesh_io.
using StlReaderFunction = vtkAlgorithm* (*)(const char* path);
inline constexpr char kStlReaderSymbol[] = "TissueformNewStlReader";
inline constexpr char kStlModule[] = "libtissueform_stl.so";  // beside the program

}  // namespace tissueform
