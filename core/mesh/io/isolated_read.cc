// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/isolated_read.h"

#include <filesystem>
#include <string>

#include "absl/strings/ascii.h"

#include "core/base/status_macros.h"
#include "core/mesh/io/gmsh_reader.h"
#include "core/mesh/io/mesh_format.h"
#include "core/mesh/io/plain_names.h"
#include "core/mesh/io/row_counts.h"
#include "core/mesh/readers/mesh_reader_call.h"

namespace tissueform {
namespace {

absl::StatusOr<RawMesh> ReadTetgenPair(const CheckedMeshFile& file, const IsolationLimits& limits) {
  TF_ASSIGN_OR_RETURN(const PlainNames names, PlainNames::Create());
  CheckedMeshFile linked = file;
  linked.path = names.Path("mesh");
  for (const std::string& path : {file.path, TetgenPartner(file.path)}) {
    TF_RETURN_IF_ERROR(CheckTetgenRows(path));
    const std::string ending =
        absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
    TF_RETURN_IF_ERROR(names.Link(path, "mesh" + ending));
  }
  return CallMeshReader(kMeshReaderProgram, linked, limits);
}

}  // namespace

absl::StatusOr<RawMesh> ReadIsolated(const CheckedMeshFile& file, const MeshReadLimits& limits) {
  const IsolationLimits isolation{limits.max_memory_bytes, limits.max_seconds};
  switch (file.format) {
    case MeshFormat::kGmsh:
    case MeshFormat::kMedit:
      return ReadGmsh(file, isolation);
    case MeshFormat::kTetgen:
      return ReadTetgenPair(file, isolation);
    case MeshFormat::kStl:
      return CallMeshReader(kStlReaderProgram, file, isolation);
    default:
      return CallMeshReader(kMeshReaderProgram, file, isolation);
  }
}

}  // namespace tissueform
