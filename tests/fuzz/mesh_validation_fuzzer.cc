// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>

#include "core/mesh/surface_validation.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

void Require(bool promise) {
  if (!promise) std::abort();
}

Positions TakePositions(Eigen::Index count, ByteSource* source) {
  Positions positions(count, 3);
  for (Eigen::Index i = 0; i < positions.size(); ++i) {
    positions.data()[i] = source->Take<double>();
  }
  return positions;
}

// Two's complement.
int32_t SignedByte(uint8_t byte) { return byte < 128 ? byte : byte - 256; }

// Indices of one byte, so that most name a vertex that is there and some do not.
TetIndices TakeTets(ByteSource* source) {
  TetIndices tets(static_cast<Eigen::Index>(source->left() / 4), 4);
  for (Eigen::Index i = 0; i < tets.size(); ++i) {
    tets.data()[i] = SignedByte(source->Take<uint8_t>());
  }
  return tets;
}

void CheckReport(const TetMesh& mesh, const MeshReport& report) {
  Require(report.usable() == CheckUsable(report).ok());
  Require(CheckTetMesh(mesh) == CheckUsable(report));
  for (const MeshDefect& defect : report.defects) {
    Require(defect.count > 0 && !defect.explanation.empty());
    Require(static_cast<Eigen::Index>(defect.examples.size()) <= defect.count);
  }
  // What is called usable has positive tets everywhere.
  if (report.usable()) Require((TetVolumes(mesh.positions(), mesh.tets()).array() > 0).all());
}

}  // namespace

void FuzzMeshValidation(const uint8_t* data, size_t size) {
  ByteSource source(data, size);
  Positions positions = TakePositions(source.Take<uint8_t>() % 32, &source);
  absl::StatusOr<TetMesh> mesh = TetMesh::Create(positions, TakeTets(&source));
  if (!mesh.ok()) return;
  CheckReport(*mesh, ValidateTetMesh(*mesh));
  TetIndices tets = mesh->tets();
  if (RepairOrientation(mesh->positions(), &tets) > 0) {
    Require((TetVolumes(mesh->positions(), tets).array() > 0).all());
  }
  const absl::StatusOr<TriangleMesh> surface =
      TriangleMesh::Create(mesh->positions(), BoundaryFacets(*mesh));
  if (!surface.ok()) return;
  const SurfaceReport report = ValidateTriangleMesh(*surface);
  Require(report.usable() == CheckDefects(report.defects).ok());
}

}  // namespace tissueform::fuzz
