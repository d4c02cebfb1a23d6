// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/tet_grid_reader.h"

#include <array>
#include <cstring>
#include <limits>
#include <set>
#include <vtkDataArray.h>
#include <vtkObjectFactory.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLDataParser.h>

#include "absl/strings/str_cat.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {
namespace {

// zlib and LZ4 cannot do better than about 1 : 1032 (a bound of the deflate format).
constexpr int64_t kBestCompression = 1032;
constexpr int kMaxComponents = 1024;

// What VTK and we hold at once: coordinates twice as doubles; connectivity, offset and type in VTK,
// four indices in ours. Attributes come on top.
constexpr int64_t kBytesPerVertex = 48;
constexpr int64_t kBytesPerTet = 57;

std::string NameOf(vtkXMLDataElement* element) {
  const char* name = element->GetAttribute("Name");
  if (name != nullptr) return name;
  return element->GetParent() == nullptr ? element->GetName() : element->GetParent()->GetName();
}

bool IsSection(vtkXMLDataElement* element) {
  return std::strcmp(element->GetName(), "PointData") == 0 ||
         std::strcmp(element->GetName(), "CellData") == 0;
}

bool IsFieldData(vtkXMLDataElement* array) {
  return array->GetParent() != nullptr &&
         std::strcmp(array->GetParent()->GetName(), "FieldData") == 0;
}

}  // namespace

vtkStandardNewMacro(TetGridReader);

int TetGridReader::Refuse(const std::string& defect) {
  if (defect_.empty()) defect_ = defect;
  DataError = 1;
  return 0;
}

int64_t TetGridReader::MostValues() const {
  if (file_bytes_ > std::numeric_limits<int64_t>::max() / kBestCompression) {
    return std::numeric_limits<int64_t>::max();
  }
  return file_bytes_ * kBestCompression;
}

int TetGridReader::ReadPiece(vtkXMLDataElement* piece) {
  if (Piece > 0) {
    return Refuse("it holds several pieces; save it again as one piece");
  }
  if (CheckCount(piece, "NumberOfPoints") == 0 || CheckCount(piece, "NumberOfCells") == 0) return 0;
  if (CheckMemory(piece) == 0) return 0;
  for (int i = 0; i < piece->GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* section = piece->GetNestedElement(i);
    if (IsSection(section) && CheckArrayHeaders(section) == 0) return 0;
  }
  return Superclass::ReadPiece(piece);
}

int TetGridReader::CheckCount(vtkXMLDataElement* piece, const char* attribute) {
  vtkTypeInt64 count = 0;
  if (piece->GetScalarAttribute(attribute, count) == 0) {
    return Refuse(absl::StrCat("its Piece has no ", attribute));
  }
  const int64_t most = std::min<int64_t>(std::numeric_limits<int32_t>::max(), MostValues());
  if (count < 0 || count > most) {
    return Refuse(absl::StrCat("its header says ", attribute, "=", count, ", which a file of ",
                               file_bytes_, " bytes cannot hold"));
  }
  return 1;
}

int TetGridReader::CheckMemory(vtkXMLDataElement* piece) {
  vtkTypeInt64 points = 0;
  vtkTypeInt64 cells = 0;
  piece->GetScalarAttribute("NumberOfPoints", points);
  piece->GetScalarAttribute("NumberOfCells", cells);
  const int64_t needed = kBytesPerVertex * points + kBytesPerTet * cells;
  if (needed <= max_memory_bytes_) return 1;
  is_over_memory_ = true;
  return Refuse(absl::StrCat("its ", points, " points and ", cells, " cells need about ", needed,
                             " bytes of memory; at most ", max_memory_bytes_,
                             " are given (MeshReadLimits.max_memory_bytes)"));
}

// VTK looks arrays up by name and position without checking either, so a missing or repeated name
// would make it read one array into another.
int TetGridReader::CheckArrayHeaders(vtkXMLDataElement* section) {
  std::set<std::string> names;
  for (int i = 0; i < section->GetNumberOfNestedElements(); ++i) {
    vtkXMLDataElement* element = section->GetNestedElement(i);
    const char* name = element->GetAttribute("Name");
    if (name == nullptr)
      return Refuse(absl::StrCat("an array of its ", section->GetName(), " has no name"));
    if (const absl::Status status = CheckAttributeName(name); !status.ok()) {
      return Refuse(std::string(status.message()));
    }
    if (!names.insert(name).second)
      return Refuse(absl::StrCat("it has two arrays named \"", name, "\""));
    int components = 1;
    element->GetScalarAttribute("NumberOfComponents", components);
    if (components < 0 || components > kMaxComponents) {
      return Refuse(absl::StrCat("array \"", name, "\" says NumberOfComponents=", components,
                                 "; at most ", kMaxComponents, " are read"));
    }
  }
  return 1;
}

// Success is claimed even where the array is too short: on failure VTK 9.1 composes its message
// from the PointData element without looking whether there is one. The defect is kept, so the file
// is still refused.
int TetGridReader::ReadArrayForCells(vtkXMLDataElement* element, vtkAbstractArray* array) {
  if (array == nullptr || Superclass::ReadArrayForCells(element, array) == 0) {
    Refuse(absl::StrCat("cell array \"", NameOf(element),
                        "\" holds fewer values than the header says"));
  }
  return 1;
}

int TetGridReader::ReadArrayValues(vtkXMLDataElement* element, vtkIdType array_index,
                                   vtkAbstractArray* array, vtkIdType start, vtkIdType count,
                                   FieldType type) {
  if (Superclass::ReadArrayValues(element, array_index, array, start, count, type) == 0) {
    return Refuse(
        absl::StrCat("array \"", NameOf(element), "\" holds fewer values than the header says"));
  }
  // Field data belong to no vertex and no tet, so that no count can be wrong, and VTK first asks
  // for one value of each of their arrays, in search of a time.
  if (IsFieldData(element) || vtkDataArray::SafeDownCast(array) == nullptr || count == 0) return 1;
  if (HasSurplus(element, array->GetDataType(), count)) {
    return Refuse(absl::StrCat("array \"", NameOf(element),
                               "\" holds more values than the header says (", count, ")"));
  }
  return NameOf(element) == "offsets" && type == CELL_DATA ? CheckLastOffset(array) : 1;
}

// The last offset is the length for which VTK reserves the connectivity.
int TetGridReader::CheckLastOffset(vtkAbstractArray* offsets) {
  const vtkVariant last = offsets->GetVariantValue(offsets->GetNumberOfValues() - 1);
  if (last.ToTypeInt64() < 0 || last.ToTypeInt64() > MostValues()) {
    return Refuse(absl::StrCat("its cell offsets end at ", last.ToTypeInt64(), ", which a file of ",
                               file_bytes_, " bytes cannot hold"));
  }
  return 1;
}

// Asks for the last value and one more. It does not ask for the one more alone, because VTK then
// looks up a compressed block that may not exist.
bool TetGridReader::HasSurplus(vtkXMLDataElement* element, int word_type, vtkIdType count) {
  std::array<std::byte, 2 * sizeof(double)> two_words;
  const auto last = static_cast<vtkTypeUInt64>(count - 1);
  vtkTypeInt64 offset = 0;
  if (element->GetScalarAttribute("offset", offset) != 0) {
    return XMLParser->ReadAppendedData(offset, two_words.data(), last, 2, word_type) == 2;
  }
  const char* format = element->GetAttribute("format");
  const bool is_ascii = format == nullptr || std::strcmp(format, "binary") != 0;
  return XMLParser->ReadInlineData(element, is_ascii ? 1 : 0, two_words.data(), last, 2,
                                   word_type) == 2;
}

}  // namespace tissueform
