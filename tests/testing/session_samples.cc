// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/session_samples.h"

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "tests/testing/meshes.h"

namespace tissueform::testing {

SampleMesh::SampleMesh(TetMesh tet_mesh) : mesh(std::move(tet_mesh)) {
  cell_arrays = {{"youngs_modulus_pa", Eigen::VectorXd::Constant(mesh.num_tets(), 1000.0)}};
}

UploadAnnouncement SampleMesh::Announcement() const {
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

std::shared_ptr<const StoredMesh> Store(const SampleMesh& sample, MeshCatalog* catalog) {
  const UploadAnnouncement announcement = sample.Announcement();
  absl::Status status = catalog->Check(announcement);
  if (status.ok()) {
    auto stored = catalog->Admit(announcement, [&sample, &announcement] {
      MeshPayload payload(announcement.shape);
      payload.Write(0, sample.Payload());
      return payload;
    });
    if (stored.ok()) return *std::move(stored);
    status = stored.status();
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
