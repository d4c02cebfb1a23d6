// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/mesh_format.h"

#include <array>
#include <filesystem>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "core/mesh/io/format_signature.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

struct Ending {
  absl::string_view ending;
  MeshFormat format;
  MeshKind kind;
};

constexpr std::array<Ending, 11> kEndings = {{
    {".vtu", MeshFormat::kVtu, MeshKind::kTets},
    {".vtk", MeshFormat::kLegacyVtk, MeshKind::kTets},
    {".msh", MeshFormat::kGmsh, MeshKind::kTets},
    {".mesh", MeshFormat::kMedit, MeshKind::kTets},
    {".node", MeshFormat::kTetgen, MeshKind::kTets},
    {".ele", MeshFormat::kTetgen, MeshKind::kTets},
    {".vtp", MeshFormat::kVtp, MeshKind::kTriangles},
    {".stl", MeshFormat::kStl, MeshKind::kTriangles},
    {".ply", MeshFormat::kPly, MeshKind::kTriangles},
    {".obj", MeshFormat::kObj, MeshKind::kTriangles},
    {".off", MeshFormat::kOff, MeshKind::kTriangles},
}};

std::string LowerEnding(const std::string& path) {
  return absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
}

const Ending* FindEnding(const std::string& path) {
  const std::string ending = LowerEnding(path);
  for (const Ending& known : kEndings) {
    if (known.ending == ending) return &known;
  }
  return nullptr;
}

std::string EndingsOf(MeshKind kind) {
  std::vector<absl::string_view> endings;
  for (const Ending& known : kEndings) {
    if (known.kind == kind) endings.push_back(known.ending);
  }
  return absl::StrJoin(endings, " ");
}

absl::Status UnknownEnding(const std::string& path) {
  if (LowerEnding(path) == ".meshb") return CannotReadMesh(path, kBinaryMeditMessage);
  return CannotReadMesh(path, absl::StrCat("its ending is not one of the supported ones: ",
                                           EndingsOf(MeshKind::kTets), " (tets), ",
                                           EndingsOf(MeshKind::kTriangles), " (surfaces)"));
}

absl::Status WrongKind(const std::string& path, MeshKind wanted) {
  if (wanted == MeshKind::kTets) {
    return CannotReadMesh(
        path, absl::StrCat("it is a surface; a mesh of tets is needed (", EndingsOf(wanted), ")"));
  }
  return CannotReadMesh(
      path, absl::StrCat("it is a mesh of tets; a surface is needed (", EndingsOf(wanted), ")"));
}

// Upper bound of what any of the libraries holds while it reads, for one byte of a file without
// compression. Gmsh needs most: an object of about 100 bytes for an element of 12 bytes or more.
constexpr int64_t kMemoryPerFileByte = 10;

absl::Status CheckSize(const std::string& path, int64_t bytes, MeshFormat format,
                       const MeshReadLimits& limits) {
  if (bytes > limits.max_file_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("mesh file ", path, " has ", bytes,
                                                     " bytes; at most ", limits.max_file_bytes,
                                                     " are read"));
  }
  // VTK's XML files may be compressed; their headers say more than their size.
  if (format != MeshFormat::kVtu && bytes > limits.max_memory_bytes / kMemoryPerFileByte) {
    return absl::ResourceExhaustedError(
        absl::StrCat("mesh file ", path, " has ", bytes, " bytes and may need ",
                     bytes * kMemoryPerFileByte, " bytes of memory to read; at most ",
                     limits.max_memory_bytes, " are given (MeshReadLimits.max_memory_bytes)"));
  }
  return absl::OkStatus();
}

absl::StatusOr<int64_t> SizeOfFile(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat("mesh file ", path, " does not exist"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return CannotReadMesh(path, "it is a folder or a device; name a mesh file");
  }
  const auto bytes = static_cast<int64_t>(std::filesystem::file_size(path, error));
  if (error) return CannotReadMesh(path, error.message());
  return bytes;
}

absl::StatusOr<CheckedMeshFile> CheckOneFile(const std::string& path, MeshFormat format,
                                             const MeshReadLimits& limits) {
  TF_ASSIGN_OR_RETURN(const int64_t bytes, SizeOfFile(path));
  TF_RETURN_IF_ERROR(CheckSize(path, bytes, format, limits));
  TF_ASSIGN_OR_RETURN(const MeshFormat found, CheckSignature(path, bytes, format));
  return CheckedMeshFile{path, found, bytes};
}

}  // namespace

absl::Status CannotReadMesh(const std::string& path, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("cannot read mesh ", path, ": ", why));
}

absl::StatusOr<MeshFormat> SurfaceFormatOfPath(const std::string& path) {
  const Ending* const ending = FindEnding(path);
  if (ending != nullptr && ending->kind == MeshKind::kTriangles) return ending->format;
  return absl::InvalidArgumentError(absl::StrCat("cannot write surface ", path,
                                                 ": its ending is not one of ",
                                                 EndingsOf(MeshKind::kTriangles)));
}

std::string TetgenPartner(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  std::string partner = LowerEnding(path) == ".ele" ? ".node" : ".ele";
  if (ending == absl::AsciiStrToUpper(ending)) absl::AsciiStrToUpper(&partner);
  return std::filesystem::path(path).replace_extension(partner).string();
}

absl::StatusOr<CheckedMeshFile> CheckMeshFile(const std::string& path, MeshKind kind,
                                              const MeshReadLimits& limits) {
  TF_RETURN_IF_ERROR(SizeOfFile(path).status());
  const Ending* const ending = FindEnding(path);
  if (ending == nullptr) return UnknownEnding(path);
  if (ending->kind != kind) return WrongKind(path, kind);
  TF_ASSIGN_OR_RETURN(CheckedMeshFile file, CheckOneFile(path, ending->format, limits));
  if (file.format == MeshFormat::kTetgen) {
    TF_ASSIGN_OR_RETURN(const CheckedMeshFile partner,
                        CheckOneFile(TetgenPartner(path), file.format, limits));
    file.bytes += partner.bytes;
  }
  return file;
}

std::vector<std::string> FilesOfTetMesh(const std::string& path) {
  const Ending* const ending = FindEnding(path);
  const bool is_pair = ending != nullptr && ending->format == MeshFormat::kTetgen;
  return is_pair ? std::vector<std::string>{path, TetgenPartner(path)}
                 : std::vector<std::string>{path};
}

}  // namespace tissueform
