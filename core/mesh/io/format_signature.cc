// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/format_signature.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/lfs_pointer.h"

namespace tissueform {
namespace {

constexpr int64_t kSampleBytes = 4096;
constexpr int64_t kBinaryStlHeaderBytes = 84;
constexpr int64_t kBinaryStlTriangleBytes = 50;
constexpr char kGmsh1Start[] = "$NOD";  // version 1 has no $MeshFormat, and its end is $ENDELM

struct Sample {
  std::string start;
  std::string end;
};

struct Look {
  MeshFormat format;
  absl::string_view what;        // "it is ..."
  absl::string_view first_word;  // with which such files begin, where they all do
};

constexpr std::array<Look, 10> kLooks = {{
    {MeshFormat::kVtu, "a VTK XML unstructured grid (.vtu)", "<"},
    {MeshFormat::kVtp, "VTK XML polygons (.vtp)", "<"},
    {MeshFormat::kLegacyVtk, "a legacy VTK file (.vtk)", "# vtk DataFile"},
    {MeshFormat::kGmsh, "a Gmsh mesh (.msh)", "$MeshFormat"},
    {MeshFormat::kMedit, "a MEDIT mesh (.mesh)", "MeshVersionFormatted"},
    {MeshFormat::kPly, "a PLY file (.ply)", "ply"},
    {MeshFormat::kTetgen, "a TetGen file (.node, .ele)", ""},
    {MeshFormat::kStl, "an STL file (.stl)", ""},
    {MeshFormat::kObj, "an OBJ file (.obj)", ""},
    {MeshFormat::kOff, "an OFF file (.off)", ""},
}};

const Look& LookOf(MeshFormat format) {
  return *std::find_if(kLooks.begin(), kLooks.end(),
                       [format](const Look& look) { return look.format == format; });
}

// Without leading blanks and lines that begin with '#'.
absl::string_view SkipComments(absl::string_view text) {
  text = absl::StripLeadingAsciiWhitespace(text);
  while (absl::StartsWith(text, "#")) {
    const size_t line_end = text.find('\n');
    if (line_end == text.npos) return {};
    text = absl::StripLeadingAsciiWhitespace(text.substr(line_end));
  }
  return text;
}

absl::string_view FirstWord(absl::string_view text) {
  return text.substr(0, text.find_first_of(" \t\r\n"));
}

bool IsObjWord(absl::string_view word) {
  static constexpr std::array<absl::string_view, 9> kWords = {"v", "vn", "vt",     "vp",    "f",
                                                              "o", "g",  "mtllib", "usemtl"};
  return std::find(kWords.begin(), kWords.end(), word) != kWords.end();
}

// OFF may carry letters for what a vertex holds beside its place: COFF, STOFF, NOFF.
bool IsOffWord(absl::string_view word) { return word.size() <= 8 && absl::EndsWith(word, "OFF"); }

bool IsCount(absl::string_view word) {
  return !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
    return absl::ascii_isdigit(static_cast<unsigned char>(c));
  });
}

// "1 0.25 3.5 ...": a node, where TetGen has counts first.
bool IsNodeLine(absl::string_view text) {
  text = text.substr(0, text.find('\n'));
  const absl::string_view first = FirstWord(text);
  const absl::string_view second =
      FirstWord(absl::StripLeadingAsciiWhitespace(text.substr(first.size())));
  double number = 0;
  return IsCount(first) && !IsCount(second) && absl::SimpleAtod(second, &number);
}

// What the first characters show; for XML the one of the two that its type says, .vtu by default.
std::optional<MeshFormat> FormatOfStart(absl::string_view start) {
  if (absl::StartsWith(start, "\xEF\xBB\xBF")) start.remove_prefix(3);
  // Before comments are left out: the first line of a legacy VTK file is a comment to all others.
  for (const Look& look : kLooks) {
    if (look.first_word.empty() || look.first_word == "<") continue;
    if (absl::StartsWith(start, look.first_word)) return look.format;
  }
  if (absl::StartsWith(start, kGmsh1Start)) return MeshFormat::kGmsh;
  const absl::string_view text = SkipComments(start);
  if (absl::StartsWith(text, "<")) {
    return absl::StrContains(text, "\"PolyData\"") ? MeshFormat::kVtp : MeshFormat::kVtu;
  }
  const absl::string_view word = FirstWord(text);
  if (word == "MeshVersionFormatted") return MeshFormat::kMedit;
  if (absl::EqualsIgnoreCase(word, "solid")) return MeshFormat::kStl;
  if (IsOffWord(word)) return MeshFormat::kOff;
  if (IsObjWord(word)) return MeshFormat::kObj;
  if (IsCount(word) && !IsNodeLine(text)) return MeshFormat::kTetgen;
  return std::nullopt;
}

// VTK's two formats of a mesh of tets, which are often saved under each other's ending.
bool IsTetGrid(MeshFormat format) {
  return format == MeshFormat::kVtu || format == MeshFormat::kLegacyVtk;
}

absl::string_view LastLine(absl::string_view end) {
  end = absl::StripTrailingAsciiWhitespace(end);
  return absl::StripLeadingAsciiWhitespace(end.substr(end.rfind('\n') + 1));
}

bool IsWholeBinaryStl(const Sample& sample, int64_t bytes) {
  uint32_t triangles = 0;
  if (bytes < kBinaryStlHeaderBytes) return false;
  std::memcpy(&triangles, sample.start.data() + kBinaryStlHeaderBytes - sizeof(triangles),
              sizeof(triangles));
  return bytes == kBinaryStlHeaderBytes + kBinaryStlTriangleBytes * int64_t{triangles};
}

// Binary STL has no mark at its start and may even begin with "solid"; its length decides.
bool LooksLike(MeshFormat format, const Sample& sample, int64_t bytes) {
  if (format == MeshFormat::kStl && IsWholeBinaryStl(sample, bytes)) return true;
  return FormatOfStart(sample.start) == format;
}

// "$EndElements" after binary data, with or without a line break between; which section is the last
// one is free. Text that goes on after the mark is left to Gmsh.
bool EndsLikeGmsh(absl::string_view end) {
  if (absl::StartsWithIgnoreCase(LastLine(end), "$End")) return true;
  end = absl::StripTrailingAsciiWhitespace(end);
  const size_t mark = end.rfind("$End");
  return mark != end.npos &&
         std::all_of(end.begin() + static_cast<std::ptrdiff_t>(mark) + 1, end.end(),
                     [](char c) { return absl::ascii_isalpha(static_cast<unsigned char>(c)); });
}

// Files that are refused under any ending, and why; empty for all others.
absl::string_view WhyNotAMesh(absl::string_view start) {
  if (IsLfsPointer(start)) return kLfsPointerMessage;
  if (absl::StartsWith(start, "MFEM ")) {
    return "it is an MFEM mesh; save it from MFEM as .vtu or Gmsh (.msh)";
  }
  // The number 1 in either byte order, and one of the versions 1 to 4.
  constexpr absl::string_view kLittle("\1\0\0\0", 4);
  constexpr absl::string_view kBig("\0\0\0\1", 4);
  if (start.size() >= 8 && ((absl::StartsWith(start, kLittle) && start[4] >= 1 && start[4] <= 4) ||
                            (absl::StartsWith(start, kBig) && start[7] >= 1 && start[7] <= 4))) {
    return kBinaryMeditMessage;
  }
  if (IsNodeLine(SkipComments(start)) || absl::StartsWith(start, "/COM") ||
      absl::StartsWith(start, "/PREP7")) {
    return "it is an ANSYS file: its first line is a node or a command, not the counts of TetGen; "
           "save the mesh as .vtu or Gmsh (.msh)";
  }
  return "";
}

absl::string_view MissingEnd(MeshFormat format, const Sample& sample, int64_t bytes) {
  switch (format) {
    case MeshFormat::kGmsh:
      if (EndsLikeGmsh(sample.end)) return "";
      return absl::StartsWith(sample.start, kGmsh1Start) ? "$ENDELM" : "$End...";
    case MeshFormat::kMedit:
      return LastLine(sample.end) == "End" ? "" : "End";
    case MeshFormat::kStl:
      return IsWholeBinaryStl(sample, bytes) ||
                     absl::StartsWithIgnoreCase(LastLine(sample.end), "endsolid")
                 ? ""
                 : "endsolid";
    default:
      return "";
  }
}

absl::Status WrongStart(const std::string& path, const Sample& sample, int64_t bytes,
                        const Look& wanted) {
  if (wanted.format == MeshFormat::kStl && bytes >= kBinaryStlHeaderBytes &&
      !FormatOfStart(sample.start)) {
    return CannotReadMesh(path,
                          "it is neither text that begins with \"solid\" nor a binary STL file of "
                          "the length in its header; it is truncated or not an STL file");
  }
  const std::optional<MeshFormat> found = FormatOfStart(sample.start);
  const absl::string_view is =
      found ? LookOf(*found).what : (wanted.first_word == "<" ? "not XML" : "of unknown format");
  return CannotReadMesh(path, absl::StrCat("it is ", is, ", but its ending promises ", wanted.what,
                                           "; rename the file"));
}

absl::StatusOr<Sample> TakeSample(const std::string& path, int64_t bytes) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot open mesh ", path, "; check its permissions"));
  }
  const auto size = static_cast<size_t>(std::min(bytes, kSampleBytes));
  Sample sample{std::string(size, '\0'), std::string(size, '\0')};
  stream.read(sample.start.data(), static_cast<std::streamsize>(size));
  stream.seekg(bytes - static_cast<int64_t>(size));
  stream.read(sample.end.data(), static_cast<std::streamsize>(size));
  if (!stream) return CannotReadMesh(path, "it cannot be read; check the disk");
  return sample;
}

}  // namespace

absl::StatusOr<MeshFormat> CheckSignature(const std::string& path, int64_t bytes,
                                          MeshFormat format) {
  if (bytes == 0) return CannotReadMesh(path, "it is empty");
  const absl::StatusOr<Sample> sample = TakeSample(path, bytes);
  if (!sample.ok()) return sample.status();
  const std::optional<MeshFormat> found = FormatOfStart(sample->start);
  if (IsTetGrid(format) && found && IsTetGrid(*found)) format = *found;
  if (!LooksLike(format, *sample, bytes)) {
    const absl::string_view why = WhyNotAMesh(sample->start);
    return why.empty() ? WrongStart(path, *sample, bytes, LookOf(format))
                       : CannotReadMesh(path, why);
  }
  if (const absl::string_view end = MissingEnd(format, *sample, bytes); !end.empty()) {
    return CannotReadMesh(path,
                          absl::StrCat("it does not end with \"", end, "\"; it is truncated"));
  }
  return format;
}

}  // namespace tissueform
