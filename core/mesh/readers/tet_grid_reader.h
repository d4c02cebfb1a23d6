// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vtkXMLUnstructuredGridReader.h>

namespace tissueform {

// VTK's reader, made strict: it takes what a header announces at its word and passes over surplus
// values in silence; this one refuses what does not fit. Internal to core/mesh/readers.
class TetGridReader : public vtkXMLUnstructuredGridReader {
 public:
  static TetGridReader* New();
  using Superclass = vtkXMLUnstructuredGridReader;

  // No file of that size can hold more than a certain number of values; larger announcements are
  // refused before memory is reserved for them.
  void set_file_bytes(int64_t file_bytes) { file_bytes_ = file_bytes; }

  // A header whose counts need more is refused before memory is reserved.
  void set_max_memory_bytes(int64_t bytes) { max_memory_bytes_ = bytes; }

  // The first thing found wrong, or empty; whether it is that the memory limit is too small.
  const std::string& defect() const { return defect_; }
  bool is_over_memory() const { return is_over_memory_; }

 protected:
  TetGridReader() = default;
  ~TetGridReader() override = default;

  int ReadPiece(vtkXMLDataElement* piece) override;
  int ReadArrayForCells(vtkXMLDataElement* element, vtkAbstractArray* array) override;
  int ReadArrayValues(vtkXMLDataElement* element, vtkIdType array_index, vtkAbstractArray* array,
                      vtkIdType start, vtkIdType count, FieldType type) override;

 private:
  int Refuse(const std::string& defect);
  int CheckMemory(vtkXMLDataElement* piece);
  int CheckCount(vtkXMLDataElement* piece, const char* attribute);
  int CheckArrayHeaders(vtkXMLDataElement* section);
  int CheckLastOffset(vtkAbstractArray* offsets);
  bool HasSurplus(vtkXMLDataElement* element, int word_type, vtkIdType count);
  int64_t MostValues() const;

  int64_t file_bytes_ = 0;
  int64_t max_memory_bytes_ = INT64_MAX;
  std::string defect_;
  bool is_over_memory_ = false;
};

}  // namespace tissueform
