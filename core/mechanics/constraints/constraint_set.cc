// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/constraint_set.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

constexpr int kFree = -2;

void SortUnique(std::vector<int32_t>* vertices) {
  std::sort(vertices->begin(), vertices->end());
  vertices->erase(std::unique(vertices->begin(), vertices->end()), vertices->end());
}

std::string RegionName(const std::vector<HandleRegion>& handles, int region) {
  return region == ConstraintSet::kFixed ? std::string("the fixed region")
                                         : absl::StrCat("handle \"", handles[region].name, "\"");
}

absl::Status CheckNames(const std::vector<HandleRegion>& handles) {
  if (handles.empty()) {
    return absl::InvalidArgumentError("no handle is given; name at least one region that moves");
  }
  std::set<std::string> names;
  for (const HandleRegion& handle : handles) {
    if (handle.name.empty()) {
      return absl::InvalidArgumentError("a handle has an empty name; give every handle a name");
    }
    if (!names.insert(handle.name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("two handles are named \"", handle.name, "\"; names must differ"));
    }
    if (handle.vertices.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "handle \"", handle.name, "\" selects no vertex; check its region against the mesh"));
    }
  }
  return absl::OkStatus();
}

// Writes the region's number at its vertices in `region_of_vertex` (#V).
absl::Status Mark(const std::vector<int32_t>& vertices, int region,
                  const std::vector<HandleRegion>& handles, std::vector<int>* region_of_vertex) {
  const auto num_vertices = static_cast<int64_t>(region_of_vertex->size());
  for (const int32_t vertex : vertices) {
    if (vertex < 0 || vertex >= num_vertices) {
      return absl::InvalidArgumentError(absl::StrCat(RegionName(handles, region), " names vertex ",
                                                     vertex, ", but the mesh has vertices 0 to ",
                                                     num_vertices - 1));
    }
    int& entry = (*region_of_vertex)[vertex];
    if (entry != kFree) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertex ", vertex, " is in ", RegionName(handles, entry), " and in ",
                       RegionName(handles, region), "; regions must not overlap"));
    }
    entry = region;
  }
  return absl::OkStatus();
}

// To length 1 within rounding. What has been normalized stays to the last bit, so that rows that
// are sent or stored give the same answer there.
void Normalize(Eigen::Vector3d* normal) {
  constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();
  if (std::abs(normal->squaredNorm() - 1) > kRounding) normal->normalize();
}

}  // namespace

absl::StatusOr<ConstraintSet> ConstraintSet::Create(Eigen::Index num_vertices,
                                                    std::vector<int32_t> fixed,
                                                    std::vector<HandleRegion> handles,
                                                    std::vector<ContactRow> contact) {
  TF_RETURN_IF_ERROR(CheckNames(handles));
  SortUnique(&fixed);
  std::vector<int> region_of_vertex(num_vertices, kFree);
  TF_RETURN_IF_ERROR(Mark(fixed, kFixed, handles, &region_of_vertex));
  for (size_t h = 0; h < handles.size(); ++h) {
    SortUnique(&handles[h].vertices);
    TF_RETURN_IF_ERROR(Mark(handles[h].vertices, static_cast<int>(h), handles, &region_of_vertex));
  }
  ConstraintSet set;
  std::vector<bool> is_constrained(static_cast<size_t>(num_vertices), false);
  for (int32_t v = 0; v < num_vertices; ++v) {
    if (region_of_vertex[v] != kFree) {
      is_constrained[static_cast<size_t>(v)] = true;
      set.constrained_.push_back(v);
      set.region_of_constrained_.push_back(region_of_vertex[v]);
    }
  }
  TF_RETURN_IF_ERROR(CheckContactRows(contact, is_constrained, static_cast<int>(handles.size())));
  for (ContactRow& row : contact) Normalize(&row.normal);
  set.contact_ = std::move(contact);
  set.fixed_ = std::move(fixed);
  set.handles_ = std::move(handles);
  return set;
}

absl::Status CheckEveryComponentConstrained(const Eigen::Ref<const CellIndices>& cells,
                                            Eigen::Index num_vertices,
                                            const ConstraintSet& constraints) {
  const ConnectedComponents components = FindConnectedComponents(cells, num_vertices);
  std::vector<bool> constrained(components.count, false);
  for (const int32_t vertex : constraints.constrained()) {
    if (const int32_t component = components.component_of_vertex[vertex]; component >= 0) {
      constrained[component] = true;
    }
  }
  const auto missing = std::find(constrained.begin(), constrained.end(), false);
  if (missing == constrained.end()) {
    return absl::OkStatus();
  }
  const auto component = static_cast<int32_t>(missing - constrained.begin());
  const auto& labels = components.component_of_vertex;
  const auto first = std::find(labels.begin(), labels.end(), component);
  return absl::InvalidArgumentError(absl::StrCat(
      "connected component ", component, " of ", components.count, " (",
      std::count(labels.begin(), labels.end(), component), " vertices, the first is vertex ",
      first - labels.begin(),
      ") has no fixed or handle vertex; add one of its vertices to a region or remove it"));
}

}  // namespace tissueform
