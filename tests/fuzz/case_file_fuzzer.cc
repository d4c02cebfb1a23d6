// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <string>

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/case_writer.h"
#include "core/planning/case_file/viewer_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

void CheckSurface(const CaseSurface& surface, int64_t mesh_vertices) {
  const Eigen::Index vertices = surface.positions.rows();
  if (!surface.positions.allFinite() || surface.triangles.minCoeff() < 0 ||
      surface.triangles.maxCoeff() >= vertices) {
    std::abort();
  }
  if (!surface.follows) return;
  if (surface.follows->vertices.rows() != vertices || surface.follows->weights.rows() != vertices ||
      surface.follows->vertices.minCoeff() < 0 ||
      surface.follows->vertices.maxCoeff() >= mesh_vertices) {
    std::abort();
  }
}

}  // namespace

void FuzzCaseFile(const uint8_t* data, size_t size) {
  const absl::string_view bytes(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<ViewerFile> viewer = ParseViewer(bytes);
  if (viewer.ok()) {
    for (const CaseSurface& surface : viewer->surfaces) CheckSurface(surface, 0);
    if (!SerializeViewer(*viewer).ok()) std::abort();
  }
  const absl::StatusOr<CaseFile> contents = ParseCase(bytes);
  const std::string message(contents.status().message());
  if (message.find('\n') != std::string::npos) std::abort();
  if (!contents.ok()) return;
  for (const CaseSurface& surface : contents->surfaces) {
    CheckSurface(surface, contents->mesh.vertex_count);
  }
  const absl::StatusOr<std::string> again = SerializeCase(*contents);
  if (!again.ok() || !ParseCase(*again).ok()) std::abort();
}

}  // namespace tissueform::fuzz
