// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/mesh/tet_mesh.h"
#include "server/session/mesh_catalog.h"
#include "server/store/session_record.h"
#include "server/store/upload_store.h"

namespace tissueform::testing {

// What a client would announce of this mesh, with one cell array "youngs_modulus_pa" of 1000 Pa.
struct SampleMesh {
  explicit SampleMesh(TetMesh tet_mesh);

  UploadAnnouncement Announcement() const;
  // All bytes in one string.
  std::string Payload() const;

  TetMesh mesh;
  std::vector<CellArray> cell_arrays;
};

// The catalog checks and keeps the sample. Aborts on errors.
std::shared_ptr<const StoredMesh> Store(const SampleMesh& sample, MeshCatalog* catalog);

// The record of a session on a stored bar: lowest layer fixed, highest layer the handle "top".
SessionRecord BarRecord(const StoredMesh& bar);

}  // namespace tissueform::testing
