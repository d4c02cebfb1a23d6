// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_checks.h"

#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/mesh/validation.h"

namespace tissueform {
namespace {

// Upper bounds of what validation and the search for the skin hold at their peak, beside the mesh.
// The most a tet takes are the four facets of the skin's search at 20 bytes, twice while they are
// sorted, or four keys of 24 bytes in the search for facets with a third tet.
constexpr int64_t kValidationBytesPerTet = 256;
constexpr int64_t kValidationBytesPerVertex = 64;

absl::Status CheckCount(int64_t count, int64_t max, absl::string_view field,
                        absl::string_view option) {
  if (count <= 0) {
    return absl::InvalidArgumentError(absl::StrCat(field, " is ", count, "; it must be positive"));
  }
  if (count > max) {
    return WithReason(absl::ResourceExhaustedError(absl::StrCat(field, " is ", count,
                                                                ", and the server accepts at most ",
                                                                max, "; raise its ", option)),
                      ErrorReason::kMeshTooLarge,
                      {{"field", std::string(field)}, {"limit", absl::StrCat(max)}});
  }
  return absl::OkStatus();
}

absl::Status CheckCellArrayNames(const std::vector<std::string>& names,
                                 const ServiceLimits& limits) {
  if (names.size() > static_cast<size_t>(limits.max_cell_arrays)) {
    return absl::InvalidArgumentError(absl::StrCat("mesh has ", names.size(), " cell arrays; send ",
                                                   limits.max_cell_arrays, " at most"));
  }
  std::set<absl::string_view> seen;
  for (const std::string& name : names) {
    if (name.empty() || name.size() > static_cast<size_t>(limits.max_name_bytes)) {
      return absl::InvalidArgumentError(absl::StrCat("name of cell array ", seen.size(), " has ",
                                                     name.size(), " bytes; it needs 1 to ",
                                                     limits.max_name_bytes));
    }
    if (!seen.insert(name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("cell array \"", name, "\" is named twice; names must differ"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckCellArraysFinite(const std::vector<CellArray>& arrays) {
  for (const CellArray& array : arrays) {
    for (Eigen::Index t = 0; t < array.values.size(); ++t) {
      if (!std::isfinite(array.values[t])) {
        return absl::InvalidArgumentError(absl::StrCat("cell array \"", array.name,
                                                       "\" is not finite at tet ", t,
                                                       "; replace NaN and infinite values"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckAnnouncedMesh(const UploadAnnouncement& mesh, const ServiceLimits& limits) {
  const MeshPayloadShape& shape = mesh.shape;
  TF_RETURN_IF_ERROR(
      CheckCount(shape.num_vertices, limits.max_vertices, "vertex_count", "--max-vertices"));
  TF_RETURN_IF_ERROR(CheckCount(shape.num_tets, limits.max_tets, "tet_count", "--max-tets"));
  TF_RETURN_IF_ERROR(CheckCellArrayNames(shape.cell_arrays, limits));
  if (mesh.total_bytes != shape.TotalBytes()) {
    return absl::InvalidArgumentError(
        absl::StrCat("total_bytes is ", mesh.total_bytes, ", but ", shape.num_vertices,
                     " vertices, ", shape.num_tets, " tets and ", shape.cell_arrays.size(),
                     " cell arrays make ", shape.TotalBytes(), " bytes; correct the header"));
  }
  TF_RETURN_IF_ERROR(
      CheckCount(mesh.total_bytes, limits.max_mesh_bytes, "total_bytes", "--max-mesh-mib"));
  if (!IsSha256Hex(mesh.sha256)) {
    return absl::InvalidArgumentError("sha256 must be 64 lower-case hexadecimal digits");
  }
  return absl::OkStatus();
}

int64_t PeakBytes(const MeshPayloadShape& shape) {
  return shape.TotalBytes() + kValidationBytesPerTet * shape.num_tets +
         kValidationBytesPerVertex * shape.num_vertices;
}

absl::StatusOr<TetMesh> CheckArrivedMesh(const std::string& sha256, MeshPayload* payload) {
  if (payload->View().Sha256() != sha256) {
    return WithReason(
        absl::DataLossError(
            "the payload does not have the declared SHA-256: it was damaged in transit, or the "
            "digest was computed over other data (see MeshHeader.sha256); send it again"),
        ErrorReason::kMeshDamagedOnItsWay);
  }
  TF_RETURN_IF_ERROR(CheckCellArraysFinite(payload->cell_arrays()));
  TF_ASSIGN_OR_RETURN(TetMesh mesh,
                      TetMesh::Create(std::move(payload->positions()), std::move(payload->tets())));
  TF_RETURN_IF_ERROR(CheckTetMesh(mesh));
  return mesh;
}

}  // namespace tissueform
