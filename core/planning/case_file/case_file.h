// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/head_frame.h"

// A case: what a planner opens, in one file (docs/case-format.md). Everything is in LPS and mm.
namespace tissueform {

// Largest sizes that are read.
inline constexpr size_t kMaxCaseBytes = size_t{512} << 20;
inline constexpr size_t kMaxCaseJsonBytes = size_t{4} << 20;
inline constexpr int64_t kMaxSurfaceTriangles = 4'000'000;

// What names the tet mesh and the bytes in which it is uploaded (core/mesh/payload).
struct CaseMesh {
  std::string name = {};  // "meshes/{sha256}"
  int64_t vertex_count = 0;
  int64_t tet_count = 0;
  std::vector<std::string> cell_arrays = {};
  std::string payload = {};
};

enum class SurfaceKind { kSkin, kBone, kSegment, kTeeth };

// How vertices of a surface move with the tet mesh: by the weighted sum of the displacements of
// three of its vertices. Weights are at least 0 and at most 1 together; 0 0 0 stays.
struct FollowedVertices {
  Eigen::Matrix<int32_t, Eigen::Dynamic, 3, Eigen::RowMajor> vertices;
  Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> weights;
};

struct CaseSurface {
  std::string name = {};
  SurfaceKind kind = SurfaceKind::kSkin;
  std::string handle = {};  // moves with it; empty: with none
  FloatPositions positions = {};
  TriangleIndices triangles = {};                // counter-clockwise seen from outside
  std::optional<FollowedVertices> follows = {};  // one row a vertex
  std::vector<uint8_t> regions = {};  // CaseSkinRegion::number a vertex, 0 none; or empty
};

struct CaseSkinRegion {
  int number = 0;
  std::string name = {};
  std::string label = {};
};

struct CaseHandle {
  std::string name = {};
  std::string label = {};
  Eigen::Vector3d pivot_mm = Eigen::Vector3d::Zero();  // about which a planner turns it
  HandlePose pose = {};                                // the plan's
  // How far a planner lets it go: each axis, both ways.
  double most_translation_mm = 15;
  double most_rotation_deg = 20;
};

struct CaseLandmark {
  std::string name = {};
  std::string label = {};
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // at rest
  std::string handle = {};                                // moves with it; empty: with none
  std::optional<int32_t> skin_vertex = {};  // of the first surface of kind kSkin, moves with it
};

// That the session request has contact rows. A reader that does not know them would take the
// sticking answer for the plan's.
struct CaseContact {
  int64_t rows = 0;  // of the session request
  // A vertex, rising, and the region to which it sticks without contact: -1 is fixed, others are
  // indices of handles. These vertices are in no region of the request.
  Eigen::Matrix<int32_t, Eigen::Dynamic, 2, Eigen::RowMajor> sticking;
};

struct CaseFile {
  std::string title = {};
  // Where it is from.
  std::string software = {};
  std::string commit = {};
  std::string created = {};  // RFC 3339, UTC
  std::string plan_sha256 = {};

  CaseMesh mesh;
  std::string session_request = {};         // tissueform.v1.CreateSessionRequest, serialised
  std::string model = {};                   // by its name in plans
  std::optional<CaseContact> contact = {};  // empty: tissue sticks to bone
  std::optional<std::string> material_ranges = {};  // tissueform.v1.MaterialRanges, serialised

  std::vector<CaseSurface> surfaces = {};
  std::vector<CaseSkinRegion> skin_regions = {};
  std::vector<CaseHandle> handles = {};
  std::vector<CaseLandmark> landmarks = {};
  HeadFrame head_frame = {};
};

// "skin", "bone", "segment", "teeth".
const char* SurfaceKindName(SurfaceKind kind);

}  // namespace tissueform
