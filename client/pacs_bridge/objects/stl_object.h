// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "client/pacs_bridge/objects/common_modules.h"
#include "client/pacs_bridge/objects/dicom_items.h"
#include "core/base/types.h"

namespace tissueform {

// A surface that is written as one model.
struct ModelSurface {
  std::string key = {};  // of ObjectKeys
  CodedTerm kind = {};
  std::string title = {};         // ASCII, for lists of documents
  bool modified = false;          // is not what the CT shows
  FloatPositions positions = {};  // #V by 3, mm, LPS
  TriangleIndices triangles = {};
};

// Binary STL: triangles as they are, in mm, with their normals; 84 + 50 #F bytes.
std::vector<uint8_t> BinaryStl(const ModelSurface& surface);

// The modules Encapsulated Document and Manufacturing 3D Model into an object with the common ones.
//
// Errors: Internal, with the tag; ResourceExhausted: too many triangles.
absl::Status WriteStlModules(const PredictionObjectsInput& input, const ModelSurface& surface,
                             DcmDataset* object);

}  // namespace tissueform
