// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include <Eigen/Core>

namespace tissueform {

// Writes values to another process, through a socket or a pipe. After the first failure, which
// means that the reader has gone away, nothing more is written. Writing to a socket never raises
// SIGPIPE.
class PipeSender {
 public:
  explicit PipeSender(int descriptor) : descriptor_(descriptor) {}

  bool ok() const { return ok_; }

  void Bytes(const void* data, size_t size);
  void Number(int64_t number);
  void Text(absl::string_view text);  // its first kMaxTextBytes
  void Outcome(const absl::Status& status);

  // An Eigen matrix: rows, columns, entries as they lie.
  template <typename Matrix>
  void Entries(const Matrix& matrix) {
    Number(matrix.rows());
    Number(matrix.cols());
    Bytes(matrix.data(), static_cast<size_t>(matrix.size()) * sizeof(typename Matrix::Scalar));
  }

  static constexpr int64_t kMaxTextBytes = 1 << 16;

 private:
  int descriptor_;
  bool ok_ = true;
};

// Reads the same in the same order. DataLoss when the sender ended in the middle or sent what it
// never would. Texts and entries, and what is asked by Reserve, take no more than `max_bytes` in
// all (ResourceExhausted); Bytes goes where the caller has the room already.
class PipeReceiver {
 public:
  PipeReceiver(int descriptor, int64_t max_bytes)
      : descriptor_(descriptor), bytes_left_(max_bytes) {}

  absl::Status Bytes(void* data, size_t size);
  absl::StatusOr<int64_t> Number(int64_t most);  // in [0, most]
  absl::StatusOr<std::string> Text();
  // What PipeSender::Outcome has sent, or why it cannot be known.
  absl::Status Outcome();
  // Asked before memory is reserved for `count` things of `size` bytes.
  absl::Status Reserve(int64_t count, int64_t size);

  template <typename Matrix>
  absl::Status Entries(int64_t most_columns, Matrix* matrix) {
    static_assert(Matrix::RowsAtCompileTime == Eigen::Dynamic, "as many rows as the sender says");
    int64_t rows = 0;
    int64_t columns = 0;
    constexpr auto kScalarBytes = static_cast<int64_t>(sizeof(typename Matrix::Scalar));
    absl::Status status = Shape(most_columns, kScalarBytes, &rows, &columns);
    if (!status.ok()) return status;
    if (Matrix::ColsAtCompileTime != Eigen::Dynamic && columns != Matrix::ColsAtCompileTime) {
      return BrokenOff();
    }
    matrix->resize(rows, columns);
    return Bytes(matrix->data(), static_cast<size_t>(rows * columns * kScalarBytes));
  }

  static absl::Status BrokenOff();

 private:
  absl::Status Shape(int64_t most_columns, int64_t scalar_bytes, int64_t* rows, int64_t* columns);

  int descriptor_;
  int64_t bytes_left_;
};

}  // namespace tissueform
