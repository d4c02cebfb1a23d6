// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/gmsh_reader.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "core/mesh/io/plain_names.h"
#include "core/mesh/io/row_counts.h"
#include "core/mesh/readers/mesh_reader_call.h"

namespace tissueform {
namespace {

std::string Slurp(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Cuts the next line off `text`, with its end.
absl::string_view TakeLine(absl::string_view* text) {
  const size_t end = text->find('\n');
  const absl::string_view line = text->substr(0, end == text->npos ? end : end + 1);
  text->remove_prefix(line.size());
  return line;
}

bool IsVersion1(absl::string_view text) { return absl::StartsWith(text, "$NOD"); }

// ASCII of version 1 or 2, whose elements are one a line, and without data that go by their
// numbers.
bool CanRenumber(absl::string_view text) {
  if (IsVersion1(text)) return true;
  TakeLine(&text);
  return absl::StartsWith(text, "2") && absl::StrContains(TakeLine(&text), " 0 ") &&
         !absl::StrContains(text, "$ElementData");
}

constexpr char kBlanks[] = " \t";

bool BeginsElements(absl::string_view line) {
  return absl::StartsWith(line, "$Elements") || absl::StartsWith(line, "$ELM");
}

// The text with the elements numbered from 1. Some programs (SOFA) give all elements the same
// number, and Gmsh then keeps only one of them.
std::string Renumber(absl::string_view text) {
  std::string result;
  int64_t number = -1;  // of the line in the elements, whose line 0 is the count
  while (!text.empty()) {
    const absl::string_view line = TakeLine(&text);
    if (absl::StartsWith(line, "$")) number = BeginsElements(line) ? 0 : -1;
    const size_t first = std::min(line.find_first_not_of(kBlanks), line.size());
    const size_t rest = line.find_first_of(kBlanks, first);
    if (number > 1 && rest != line.npos) {
      absl::StrAppend(&result, number - 1, line.substr(rest));
    } else {
      result.append(line.data(), line.size());
    }
    number += number >= 0 ? 1 : 0;
  }
  return result;
}

absl::StatusOr<RawMesh> ReadUnderPlainName(const PlainNames& names, absl::string_view name,
                                           CheckedMeshFile file, const IsolationLimits& limits) {
  file.path = names.Path(name);
  return CallMeshReader(kGmshReaderProgram, file, limits);
}

}  // namespace

absl::StatusOr<RawMesh> ReadGmsh(const CheckedMeshFile& file, const IsolationLimits& limits) {
  TF_ASSIGN_OR_RETURN(const PlainNames names, PlainNames::Create());
  if (file.format == MeshFormat::kMedit) {
    TF_RETURN_IF_ERROR(CheckMeditLines(file.path));
    TF_RETURN_IF_ERROR(names.Link(file.path, "a.mesh"));
    return ReadUnderPlainName(names, "a.mesh", file, limits);
  }
  TF_RETURN_IF_ERROR(names.Link(file.path, "a.msh"));
  absl::StatusOr<RawMesh> mesh = ReadUnderPlainName(names, "a.msh", file, limits);
  if (!absl::IsAlreadyExists(mesh.status())) return mesh;
  const std::string text = Slurp(file.path);
  if (!CanRenumber(text)) return absl::InvalidArgumentError(mesh.status().message());
  TF_RETURN_IF_ERROR(names.Write("b.msh", Renumber(text)));
  return ReadUnderPlainName(names, "b.msh", file, limits);
}

}  // namespace tissueform
