// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The binary form in which a mesh travels and by which it is named: positions (float64, #V by 3),
// tets (int32, #T by 4), then each cell array (float64, #T), little-endian, without gaps.
// proto/tissueform/v1/mesh_service.proto says it to the world.

// What a payload holds.
struct MeshPayloadShape {
  int64_t num_vertices = 0;
  int64_t num_tets = 0;
  std::vector<std::string> cell_arrays;

  // Size of the payload. REQUIRES: counts so small that it fits (see the limits of the server).
  int64_t TotalBytes() const;
  // The shape in words; what a mesh is named by begins with it.
  std::string Text() const;
};

// A named array with one number per tet.
struct CellArray {
  std::string name;
  Eigen::VectorXd values;  // #T
};

// The shape and the bytes of a mesh, without a copy. The segments point into the arguments.
struct MeshPayloadView {
  MeshPayloadShape shape;
  std::vector<absl::string_view> segments;  // positions, tets, then the cell arrays

  // What names the mesh: SHA-256 of the text of the shape and the segments.
  std::string Sha256() const;
};

// REQUIRES: every array has one value per tet.
MeshPayloadView ViewMeshPayload(const Positions& positions, const TetIndices& tets,
                                const std::vector<CellArray>& cell_arrays);

// A payload that is being received. Bytes go straight to their places in the final arrays: nothing
// is held twice.
class MeshPayload {
 public:
  // Allocates, without filling. REQUIRES: counts are not negative.
  explicit MeshPayload(const MeshPayloadShape& shape);

  // REQUIRES: offset + bytes.size() <= TotalBytes().
  void Write(int64_t offset, absl::string_view bytes);

  MeshPayloadView View() const { return ViewMeshPayload(positions_, tets_, cell_arrays_); }

  Positions& positions() { return positions_; }
  TetIndices& tets() { return tets_; }
  std::vector<CellArray>& cell_arrays() { return cell_arrays_; }

 private:
  Positions positions_;
  TetIndices tets_;
  std::vector<CellArray> cell_arrays_;
};

}  // namespace tissueform
