// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <string>
#include <utility>

#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

MeshPayloadShape TakeShape(ByteSource* source) {
  MeshPayloadShape shape;
  shape.num_vertices = source->Take<uint8_t>();
  shape.num_tets = source->Take<uint8_t>();
  const size_t num_arrays = source->Take<uint8_t>() % 4;
  for (size_t i = 0; i < num_arrays; ++i) {
    shape.cell_arrays.emplace_back(source->TakeBytes(source->Take<uint8_t>() % 16));
  }
  return shape;
}

// The bytes of a payload, as they were sent.
std::string Fill(const MeshPayloadShape& shape, ByteSource* source, MeshPayload* payload) {
  std::string sent(static_cast<size_t>(shape.TotalBytes()), '\0');
  payload->Write(0, sent);
  size_t offset = 0;
  while (source->left() > 0 && offset < sent.size()) {
    const size_t wanted = 1 + source->Take<uint8_t>();
    const absl::string_view chunk = source->TakeBytes(std::min(wanted, sent.size() - offset));
    payload->Write(static_cast<int64_t>(offset), chunk);
    sent.replace(offset, chunk.size(), chunk.data(), chunk.size());
    offset += chunk.size();
  }
  return sent;
}

}  // namespace

void FuzzMeshPayload(const uint8_t* data, size_t size) {
  ByteSource source(data, size);
  const MeshPayloadShape shape = TakeShape(&source);
  MeshPayload payload(shape);
  const std::string sent = Fill(shape, &source, &payload);
  std::string arrived;
  for (const absl::string_view segment : payload.View().segments) {
    arrived.append(segment.data(), segment.size());
  }
  if (arrived != sent || payload.View().Sha256().size() != 64) std::abort();
  const absl::StatusOr<TetMesh> mesh =
      TetMesh::Create(std::move(payload.positions()), std::move(payload.tets()));
  if (mesh.ok() && mesh->tets().maxCoeff() >= mesh->num_vertices()) std::abort();
}

}  // namespace tissueform::fuzz
