// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/triangle_mesh_io.h"

#include <exception>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/isolated_read.h"
#include "core/mesh/io/mesh_format.h"
#include "core/mesh/io/raw_mesh_check.h"
#include "core/mesh/io/surface_writer.h"
#include "core/mesh/io/vtk_export.h"

namespace tissueform {
namespace {

absl::StatusOr<TriangleMeshFile> ToTriangleMeshFile(RawMesh raw, FileSpace space) {
  TF_RETURN_IF_ERROR(CheckRawMesh(raw));
  if (space == FileSpace::kRas) TurnRasToLps(&raw);
  TF_ASSIGN_OR_RETURN(TriangleMesh mesh, TriangleMesh::Create(std::move(raw.positions), raw.cells));
  return TriangleMeshFile{.mesh = std::move(mesh),
                          .point_data = std::move(raw.point_data),
                          .cell_data = std::move(raw.cell_data),
                          .split_polygons = raw.split_polygons,
                          .space = space};
}

absl::StatusOr<std::string> Serialize(MeshFormat format, const TriangleMeshFile& file) {
  if (format == MeshFormat::kVtp) return VtpText(file);
  if (!file.point_data.empty() || !file.cell_data.empty()) {
    return absl::InvalidArgumentError("only .vtp keeps arrays; name such a file");
  }
  return SurfaceFileContents(file.mesh, format, file.space == FileSpace::kLps);
}

}  // namespace

bool NamesSurface(const std::string& path) { return SurfaceFormatOfPath(path).ok(); }

absl::StatusOr<TriangleMeshFile> ReadTriangleMesh(const std::string& path,
                                                  const MeshReadLimits& limits) {
  TF_ASSIGN_OR_RETURN(const CheckedMeshFile file,
                      CheckMeshFile(path, MeshKind::kTriangles, limits));
  try {
    absl::StatusOr<RawMesh> raw = ReadIsolated(file, limits);
    if (!raw.ok()) return WithMeshName(path, raw.status());
    absl::StatusOr<TriangleMeshFile> mesh = ToTriangleMeshFile(*std::move(raw), SpaceOf(file));
    if (!mesh.ok()) return WithMeshName(path, mesh.status());
    return mesh;
  } catch (const std::bad_alloc&) {
    return WithMeshName(path, absl::ResourceExhaustedError("there is not enough memory for it"));
  }
}

absl::Status WriteTriangleMesh(const std::string& path, const TriangleMeshFile& file) {
  TF_ASSIGN_OR_RETURN(const MeshFormat format, SurfaceFormatOfPath(path));
  try {
    const absl::StatusOr<std::string> text = Serialize(format, file);
    if (text.ok()) return WriteFileAtomically(path, *text);
    return absl::Status(text.status().code(),
                        absl::StrCat("cannot write mesh ", path, ": ", text.status().message()));
  } catch (const std::exception& exception) {
    return absl::ResourceExhaustedError(
        absl::StrCat("cannot write mesh ", path, ": ", exception.what()));
  }
}

}  // namespace tissueform
