// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>

namespace tissueform {

// A packed matrix (PackedColumns), or columns in turn of one: `rows` by `columns`, of which the
// last `full` have lower halves.
struct PackedPart {
  const double* steps = nullptr;
  const int16_t* upper = nullptr;
  const int16_t* lower = nullptr;
  size_t rows = 0;
  size_t columns = 0;
  size_t full = 0;
};

// How much of the columns a product reads.
struct ColumnReading {
  size_t first = 0;       // those before it are left out
  size_t first_full = 0;  // from it on with all digits
};

// What BasicAnswerEvaluator multiplies with where entries stay as they came: a view of them, for
// any processor that a compiler vectorizes for.
//
// Constant: any number of threads may ask at once.
class PackedMatrix {
 public:
  // Whether a product reads no more than its tolerance needs, and whether entries are kept, so that
  // those of the answers may go. The page reads all, as docs/prepared-answers.md says.
  static constexpr bool kReadsByTolerance = false;
  static constexpr bool kKeepsEntries = false;

  // `part` outlives it.
  explicit PackedMatrix(const PackedPart& part) : part_(part) {}

  // product = this * factors, #rows by `width`, row-major, in single precision; `width` is 1 or 3.
  // Columns are added in their order. REQUIRES: columns() - full_columns() <= first_full <=
  // columns() of the reading, and first <= first_full.
  void Multiply(const double* factors, size_t width, const ColumnReading& reading,
                float* product) const;

  // The same of one row with all digits of all columns: `width` numbers, the same to the bit.
  void MultiplyRow(size_t row, const double* factors, size_t width, float* product) const;

  size_t rows() const { return part_.rows; }
  size_t columns() const { return part_.columns; }
  size_t full_columns() const { return part_.full; }
  size_t bytes_held() const { return 0; }

 private:
  PackedPart part_;
};

}  // namespace tissueform
