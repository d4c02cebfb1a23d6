// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_defects.h"

#include <algorithm>
#include <array>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"

#include "core/mesh/generation/triangle_intersections.h"
#include "core/mesh/half_edges.h"

namespace tissueform {
namespace {

bool LeavesNoInside(std::string_view kind) {
  return kind == "open_edges" || kind == "non_manifold_edges" || kind == "turned_triangles";
}

void Mark(Eigen::Index triangle, TriangleFlaw flaw, SurfaceDefects* defects) {
  TriangleFlaw& marked = defects->flaws[static_cast<size_t>(triangle)];
  marked = std::max(marked, flaw);
}

void MarkEdges(const TriangleIndices& triangles, SurfaceDefects* defects) {
  ForEachEdge(triangles, [&](EdgeUses uses) {
    for (const HalfEdge& use : uses) {
      if (IsTurned(uses)) Mark(use.triangle, TriangleFlaw::kTurned, defects);
      if (IsOpen(uses)) Mark(use.triangle, TriangleFlaw::kOpenEdge, defects);
      if (IsNonManifold(uses)) Mark(use.triangle, TriangleFlaw::kNonManifold, defects);
    }
  });
}

void FindDuplicates(const TriangleIndices& triangles, SurfaceDefects* defects) {
  std::set<std::array<int32_t, 3>> seen;
  std::vector<Eigen::Index> duplicates;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    std::array<int32_t, 3> corners = {triangles(f, 0), triangles(f, 1), triangles(f, 2)};
    std::sort(corners.begin(), corners.end());
    if (seen.insert(corners).second) continue;
    duplicates.push_back(f);
    Mark(f, TriangleFlaw::kDuplicate, defects);
  }
  AddDefect({"duplicate_triangles", Severity::kError, "triangles repeat an earlier one", "triangle",
             "remove them"},
            duplicates, &defects->defects);
}

void FindIntersections(const TriangleMesh& surface, SurfaceDefects* defects) {
  const TriangleIntersections found = FindTriangleIntersections(surface);
  std::set<Eigen::Index> triangles;
  for (const auto& [a, b] : found.pairs) {
    triangles.insert({a, b});
    Mark(a, TriangleFlaw::kIntersecting, defects);
    Mark(b, TriangleFlaw::kIntersecting, defects);
  }
  defects->num_intersecting_pairs = static_cast<int64_t>(found.pairs.size());
  defects->found_all_pairs = found.complete;
  AddDefect({"intersecting_triangles", Severity::kError, "triangles intersect", "triangle",
             "separate them, or remesh the surface (`mesh generate --remesh-mm`)"},
            {triangles.begin(), triangles.end()}, &defects->defects);
}

void FindInwardFacing(SurfaceDefects* defects) {
  if (defects->report.enclosed_volume_mm3 >= 0) return;
  MeshDefect defect{"inward_facing", Severity::kWarning, 1, {}, ""};
  defect.explanation = "the closed surface faces inward; its inside is used";
  defects->defects.push_back(defect);
}

}  // namespace

SurfaceDefects FindSurfaceDefects(const TriangleMesh& surface) {
  SurfaceDefects defects;
  defects.flaws.assign(static_cast<size_t>(surface.num_triangles()), TriangleFlaw::kNone);
  defects.report = ValidateTriangleMesh(surface);
  defects.defects = defects.report.defects;
  for (MeshDefect& defect : defects.defects) {
    if (LeavesNoInside(defect.kind)) defect.severity = Severity::kError;
  }
  MarkEdges(surface.triangles(), &defects);
  FindDuplicates(surface.triangles(), &defects);
  for (const Eigen::Index f : DegenerateTriangles(surface)) {
    Mark(f, TriangleFlaw::kDegenerate, &defects);
  }
  if (defects.Find("non_finite_vertices") == nullptr) {
    FindIntersections(surface, &defects);
    FindInwardFacing(&defects);
  }
  std::stable_partition(defects.defects.begin(), defects.defects.end(),
                        [](const MeshDefect& d) { return d.severity == Severity::kError; });
  return defects;
}

Attribute FlawArray(const SurfaceDefects& defects) {
  std::vector<uint8_t> numbers;
  for (const TriangleFlaw flaw : defects.flaws) numbers.push_back(static_cast<uint8_t>(flaw));
  return {"defect", 1, std::move(numbers)};
}

absl::Status CheckMeshable(const SurfaceDefects& defects) {
  std::string message;
  for (const MeshDefect& defect : defects.defects) {
    if (defect.severity != Severity::kError) continue;
    if (message.empty()) {
      message = absl::StrCat("the surface cannot be filled with tets: ", defect.explanation);
    } else {
      absl::StrAppend(&message, "; also ", defect.count, " ",
                      absl::string_view(defect.kind.data(), defect.kind.size()));
    }
  }
  return message.empty() ? absl::OkStatus() : absl::InvalidArgumentError(message);
}

}  // namespace tissueform
