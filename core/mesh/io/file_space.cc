// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/file_space.h"

#include <fstream>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

constexpr size_t kStlHeaderBytes = 80;
// Comments farther in a file are not looked at.
constexpr size_t kCommentBytes = 4096;
constexpr char kNormals[] = "Normals";  // as VTK's PLY reader calls them

// How a comment line begins; null if the format has no comments to read.
const char* CommentMark(MeshFormat format) {
  switch (format) {
    case MeshFormat::kStl:
      return "";  // all of the header
    case MeshFormat::kPly:
      return "comment";
    case MeshFormat::kObj:
      return "#";
    default:
      return nullptr;
  }
}

template <typename T>
void NegateXAndY(std::vector<T>* values) {
  for (size_t i = 0; i + 2 < values->size(); i += 3) {
    (*values)[i] = static_cast<T>(-(*values)[i]);
    (*values)[i + 1] = static_cast<T>(-(*values)[i + 1]);
  }
}

}  // namespace

FileSpace SpaceOf(const CheckedMeshFile& file) {
  const char* const mark = CommentMark(file.format);
  if (mark == nullptr) return FileSpace::kUnstated;
  std::string start(file.format == MeshFormat::kStl ? kStlHeaderBytes : kCommentBytes, '\0');
  std::ifstream stream(file.path, std::ios::binary);
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<size_t>(stream.gcount()));
  for (const absl::string_view line : absl::StrSplit(start, '\n')) {
    if (!absl::StartsWith(line, mark)) continue;
    if (absl::StrContains(line, "SPACE=RAS")) return FileSpace::kRas;
    if (absl::StrContains(line, "SPACE=LPS")) return FileSpace::kLps;
  }
  return FileSpace::kUnstated;
}

void TurnRasToLps(RawMesh* mesh) {
  mesh->positions.leftCols<2>() *= -1;
  for (Attribute& array : mesh->point_data) {
    if (array.name != kNormals || array.components != 3) continue;
    std::visit([](auto& values) { NegateXAndY(&values); }, array.values);
  }
}

}  // namespace tissueform
