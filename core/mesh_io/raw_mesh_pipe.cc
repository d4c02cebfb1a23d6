// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/raw_mesh_pipe.h"

#include <cerrno>
#include <cstdint>
#include <unistd.h>
#include <utility>

#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int64_t kMostTextBytes = 1 << 16;
constexpr int64_t kMostArrays = 1 << 16;

class Sender {
 public:
  explicit Sender(int descriptor) : descriptor_(descriptor) {}

  bool ok() const { return ok_; }

  void Bytes(const void* data, size_t size) {
    const char* next = static_cast<const char*>(data);
    while (ok_ && size > 0) {
      const ssize_t written = write(descriptor_, next, size);
      if (written < 0 && errno == EINTR) continue;
      ok_ = written > 0;
      next += ok_ ? written : 0;
      size -= ok_ ? static_cast<size_t>(written) : 0;
    }
  }
  void Number(int64_t number) { Bytes(&number, sizeof(number)); }
  void Text(absl::string_view text) {
    text = text.substr(0, kMostTextBytes);
    Number(static_cast<int64_t>(text.size()));
    Bytes(text.data(), text.size());
  }
  template <typename Matrix>
  void Entries(const Matrix& matrix) {
    Number(matrix.rows());
    Number(matrix.cols());
    Bytes(matrix.data(), static_cast<size_t>(matrix.size()) * sizeof(typename Matrix::Scalar));
  }
  void Attributes(const std::vector<Attribute>& attributes) {
    Number(static_cast<int64_t>(attributes.size()));
    for (const Attribute& attribute : attributes) {
      Text(attribute.name);
      Number(attribute.components);
      Number(static_cast<int64_t>(attribute.values.index()));
      std::visit(
          [this](const auto& values) {
            Number(static_cast<int64_t>(values.size()));
            Bytes(values.data(), values.size() * sizeof(values[0]));
          },
          attribute.values);
    }
  }

 private:
  int descriptor_;
  bool ok_ = true;
};

absl::Status BrokenOff() {
  return absl::DataLossError("what the child process sent breaks off or makes no sense");
}

class Receiver {
 public:
  Receiver(int descriptor, int64_t max_bytes) : descriptor_(descriptor), bytes_left_(max_bytes) {}

  absl::Status Bytes(void* data, size_t size) {
    char* next = static_cast<char*>(data);
    while (size > 0) {
      const ssize_t count = read(descriptor_, next, size);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return BrokenOff();
      next += count;
      size -= static_cast<size_t>(count);
    }
    return absl::OkStatus();
  }

  // A number in [0, most].
  absl::StatusOr<int64_t> Number(int64_t most) {
    int64_t number = 0;
    TF_RETURN_IF_ERROR(Bytes(&number, sizeof(number)));
    if (number < 0 || number > most) return BrokenOff();
    return number;
  }

  absl::StatusOr<std::string> Text() {
    TF_ASSIGN_OR_RETURN(const int64_t size, Number(kMostTextBytes));
    std::string text(static_cast<size_t>(size), '\0');
    TF_RETURN_IF_ERROR(Bytes(text.data(), text.size()));
    return text;
  }

  // Asked before memory is reserved for `count` things of `size` bytes.
  absl::Status Reserve(int64_t count, int64_t size) {
    if (count > bytes_left_ / size) {
      return absl::ResourceExhaustedError("the mesh is larger than the memory limit");
    }
    bytes_left_ -= count * size;
    return absl::OkStatus();
  }

  template <typename Matrix>
  absl::Status Entries(int64_t most_columns, Matrix* matrix) {
    TF_ASSIGN_OR_RETURN(const int64_t rows, Number(INT32_MAX));
    TF_ASSIGN_OR_RETURN(const int64_t columns, Number(most_columns));
    TF_RETURN_IF_ERROR(Reserve(rows * columns, sizeof(typename Matrix::Scalar)));
    if (Matrix::ColsAtCompileTime != Eigen::Dynamic && columns != Matrix::ColsAtCompileTime) {
      return BrokenOff();
    }
    matrix->resize(rows, columns);
    return Bytes(matrix->data(),
                 static_cast<size_t>(matrix->size()) * sizeof(typename Matrix::Scalar));
  }

  absl::Status Values(Attribute::Values* values) {
    return std::visit(
        [this](auto& vector) -> absl::Status {
          constexpr auto kSize = static_cast<int64_t>(sizeof(vector[0]));
          TF_ASSIGN_OR_RETURN(const int64_t count, Number(INT64_MAX / kSize));
          TF_RETURN_IF_ERROR(Reserve(count, kSize));
          vector.resize(static_cast<size_t>(count));
          return Bytes(vector.data(), vector.size() * kSize);
        },
        *values);
  }

  absl::Status Attributes(std::vector<Attribute>* attributes) {
    TF_ASSIGN_OR_RETURN(const int64_t count, Number(kMostArrays));
    for (int64_t i = 0; i < count; ++i) {
      Attribute attribute;
      TF_ASSIGN_OR_RETURN(attribute.name, Text());
      TF_ASSIGN_OR_RETURN(const int64_t components, Number(INT32_MAX));
      TF_ASSIGN_OR_RETURN(const int64_t type, Number(kNumTypes - 1));
      attribute.components = static_cast<int>(components);
      attribute.values = EmptyOfEachType()[static_cast<size_t>(type)];
      TF_RETURN_IF_ERROR(Values(&attribute.values));
      attributes->push_back(std::move(attribute));
    }
    return absl::OkStatus();
  }

 private:
  static constexpr int64_t kNumTypes = std::variant_size_v<Attribute::Values>;

  template <size_t... I>
  static std::vector<Attribute::Values> MakeEmpty(std::index_sequence<I...>) {
    return {Attribute::Values(std::in_place_index<I>)...};
  }
  // One empty vector of each number type, in the order of the variant.
  static std::vector<Attribute::Values> EmptyOfEachType() {
    return MakeEmpty(std::make_index_sequence<kNumTypes>());
  }

  int descriptor_;
  int64_t bytes_left_;
};

}  // namespace

bool SendRawMesh(int descriptor, const absl::StatusOr<RawMesh>& mesh) {
  Sender sender(descriptor);
  sender.Number(static_cast<int64_t>(mesh.status().code()));
  sender.Text(mesh.status().message());
  if (!mesh.ok()) return sender.ok();
  sender.Entries(mesh->positions);
  sender.Entries(mesh->cells);
  sender.Attributes(mesh->point_data);
  sender.Attributes(mesh->cell_data);
  sender.Number(mesh->split_polygons);
  return sender.ok();
}

absl::StatusOr<RawMesh> ReceiveRawMesh(int descriptor, int64_t max_bytes) {
  Receiver receiver(descriptor, max_bytes);
  TF_ASSIGN_OR_RETURN(const int64_t code, receiver.Number(16));
  TF_ASSIGN_OR_RETURN(const std::string message, receiver.Text());
  if (code != 0) return absl::Status(static_cast<absl::StatusCode>(code), message);
  RawMesh mesh;
  TF_RETURN_IF_ERROR(receiver.Entries(3, &mesh.positions));
  TF_RETURN_IF_ERROR(receiver.Entries(4, &mesh.cells));
  TF_RETURN_IF_ERROR(receiver.Attributes(&mesh.point_data));
  TF_RETURN_IF_ERROR(receiver.Attributes(&mesh.cell_data));
  TF_ASSIGN_OR_RETURN(mesh.split_polygons, receiver.Number(INT64_MAX));
  return mesh;
}

}  // namespace tissueform
