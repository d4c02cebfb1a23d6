// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mechanics/constraints/contact_row.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Vertices that move together by one pose.
struct HandleRegion {
  std::string name;
  std::vector<int32_t> vertices;

  friend bool operator==(const HandleRegion&, const HandleRegion&) = default;
};

// Which vertices are fixed, which belong to which handle; all others are free, and some of those
// touch bone or each other. Immutable.
class ConstraintSet {
 public:
  // Vertices may come in any order and more than once within one region.
  //
  // Errors (InvalidArgument, naming the region and the first offending vertex): no handle; an empty
  // handle; a handle without a name or with the name of another; a vertex outside [0, #V); a vertex
  // in two regions. An empty fixed region is legal here (the handles carry everything); a plan
  // demands one. And those of CheckContactRows.
  static absl::StatusOr<ConstraintSet> Create(Eigen::Index num_vertices, std::vector<int32_t> fixed,
                                              std::vector<HandleRegion> handles,
                                              std::vector<ContactRow> contact = {});
  static absl::StatusOr<ConstraintSet> Create(const TetMesh& mesh, std::vector<int32_t> fixed,
                                              std::vector<HandleRegion> handles,
                                              std::vector<ContactRow> contact = {}) {
    return Create(mesh.num_vertices(), std::move(fixed), std::move(handles), std::move(contact));
  }

  const std::vector<int32_t>& fixed() const { return fixed_; }           // rising
  const std::vector<HandleRegion>& handles() const { return handles_; }  // vertices rising
  // Fixed and handle vertices together, rising.
  const std::vector<int32_t>& constrained() const { return constrained_; }
  // For every entry of constrained(): kFixed or the index of its handle.
  static constexpr int kFixed = -1;
  const std::vector<int>& region_of_constrained() const { return region_of_constrained_; }
  // In the order in which they were given; empty: tissue sticks to bone.
  const std::vector<ContactRow>& contact() const { return contact_; }

 private:
  ConstraintSet() = default;

  std::vector<int32_t> fixed_;
  std::vector<HandleRegion> handles_;
  std::vector<int32_t> constrained_;
  std::vector<int> region_of_constrained_;
  std::vector<ContactRow> contact_;
};

// InvalidArgument, naming the component by its number of vertices and its first one, when a
// connected component has no constrained vertex: the system would be singular.
absl::Status CheckEveryComponentConstrained(const Eigen::Ref<const CellIndices>& cells,
                                            Eigen::Index num_vertices,
                                            const ConstraintSet& constraints);

}  // namespace tissueform
