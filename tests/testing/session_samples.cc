// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/session_samples.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "tests/testing/meshes.h"

namespace tissueform::testing {

SampleMesh::SampleMesh(TetMesh tet_mesh) : mesh(std::move(tet_mesh)) {
  cell_arrays = {{"youngs_modulus_pa", Eigen::VectorXd::Constant(mesh.num_tets(), 1000.0)}};
}

MeshAnnouncement SampleMesh::Announcement() const {
  const MeshPayloadView view = ViewMeshPayload(mesh.positions(), mesh.tets(), cell_arrays);
  return {view.shape, view.shape.TotalBytes(), view.Sha256()};
}

std::string SampleMesh::Payload() const {
  std::string payload;
  for (const absl::string_view segment :
       ViewMeshPayload(mesh.positions(), mesh.tets(), cell_arrays).segments) {
    payload.append(segment.data(), segment.size());
  }
  return payload;
}

std::shared_ptr<const StoredMesh> Store(const SampleMesh& sample, MeshCatalog* catalog,
                                        size_t chunk_bytes) {
  auto upload = catalog->StartUpload(sample.Announcement());
  absl::Status status = upload.status();
  const std::string payload = sample.Payload();
  for (size_t offset = 0; status.ok() && offset < payload.size(); offset += chunk_bytes) {
    status = (*upload)->Write(static_cast<int64_t>(offset),
                              absl::string_view(payload).substr(offset, chunk_bytes),
                              offset + chunk_bytes >= payload.size());
  }
  if (status.ok()) {
    if (auto stored = catalog->Finish(*std::move(upload)); stored.ok()) {
      return *std::move(stored);
    } else {
      status = stored.status();
    }
  }
  std::fprintf(stderr, "cannot store the sample: %s\n", status.ToString().c_str());
  std::abort();
}

SessionRecord BarRecord(const StoredMesh& bar) {
  const ConstraintSet ends = BarEnds(bar.mesh);
  SessionRecord record;
  record.mesh_sha256 = bar.sha256;
  record.stiffness = "youngs_modulus_pa";
  record.fixed = ends.fixed();
  record.handles = ends.handles();
  return record;
}

}  // namespace tissueform::testing
