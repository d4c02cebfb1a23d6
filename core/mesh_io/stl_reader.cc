// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/stl_reader.h"

#include <vtkSTLReader.h>

extern "C" vtkAlgorithm* TissueformNewStlReader(const char* path) {
  vtkSTLReader* const reader = vtkSTLReader::New();
  reader->SetFileName(path);
  return reader;
}
