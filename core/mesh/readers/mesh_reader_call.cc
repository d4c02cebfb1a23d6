// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/mesh_reader_call.h"

#include <cstdint>
#include <utility>
#include <variant>

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "reading it";
constexpr int64_t kMaxArrays = 1 << 16;
constexpr int64_t kNumTypes = std::variant_size_v<Attribute::Values>;

void SendAttributes(const std::vector<Attribute>& attributes, PipeSender* sender) {
  sender->Number(static_cast<int64_t>(attributes.size()));
  for (const Attribute& attribute : attributes) {
    sender->Text(attribute.name);
    sender->Number(attribute.components);
    sender->Number(static_cast<int64_t>(attribute.values.index()));
    std::visit(
        [&](const auto& values) {
          sender->Number(static_cast<int64_t>(values.size()));
          sender->Bytes(values.data(), values.size() * sizeof(values[0]));
        },
        attribute.values);
  }
}

template <size_t... I>
std::vector<Attribute::Values> MakeEmpty(std::index_sequence<I...> /*types*/) {
  return {Attribute::Values(std::in_place_index<I>)...};
}

// One empty vector of each number type, in the order of the variant.
std::vector<Attribute::Values> EmptyOfEachType() {
  return MakeEmpty(std::make_index_sequence<kNumTypes>());
}

absl::Status ReceiveValues(PipeReceiver* receiver, Attribute::Values* values) {
  return std::visit(
      [&](auto& vector) -> absl::Status {
        constexpr auto kSize = static_cast<int64_t>(sizeof(vector[0]));
        TF_ASSIGN_OR_RETURN(const int64_t count, receiver->Number(INT64_MAX / kSize));
        TF_RETURN_IF_ERROR(receiver->Reserve(count, kSize));
        vector.resize(static_cast<size_t>(count));
        return receiver->Bytes(vector.data(), vector.size() * kSize);
      },
      *values);
}

absl::Status ReceiveAttributes(PipeReceiver* receiver, std::vector<Attribute>* attributes) {
  TF_ASSIGN_OR_RETURN(const int64_t count, receiver->Number(kMaxArrays));
  for (int64_t i = 0; i < count; ++i) {
    Attribute attribute;
    TF_ASSIGN_OR_RETURN(attribute.name, receiver->Text());
    TF_ASSIGN_OR_RETURN(const int64_t components, receiver->Number(INT32_MAX));
    TF_ASSIGN_OR_RETURN(const int64_t type, receiver->Number(kNumTypes - 1));
    attribute.components = static_cast<int>(components);
    attribute.values = EmptyOfEachType()[static_cast<size_t>(type)];
    TF_RETURN_IF_ERROR(ReceiveValues(receiver, &attribute.values));
    attributes->push_back(std::move(attribute));
  }
  return absl::OkStatus();
}

void SendRawMesh(const absl::StatusOr<RawMesh>& mesh, PipeSender* sender) {
  sender->Outcome(mesh.status());
  if (!mesh.ok()) return;
  sender->Entries(mesh->positions);
  sender->Entries(mesh->cells);
  SendAttributes(mesh->point_data, sender);
  SendAttributes(mesh->cell_data, sender);
  sender->Number(mesh->split_polygons);
  sender->Number(mesh->left_out_cells);
}

absl::StatusOr<RawMesh> ReceiveRawMesh(int descriptor, int64_t max_bytes) {
  PipeReceiver receiver(descriptor, max_bytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  RawMesh mesh;
  TF_RETURN_IF_ERROR(receiver.Entries(3, &mesh.positions));
  TF_RETURN_IF_ERROR(receiver.Entries(4, &mesh.cells));
  TF_RETURN_IF_ERROR(ReceiveAttributes(&receiver, &mesh.point_data));
  TF_RETURN_IF_ERROR(ReceiveAttributes(&receiver, &mesh.cell_data));
  TF_ASSIGN_OR_RETURN(mesh.split_polygons, receiver.Number(INT64_MAX));
  TF_ASSIGN_OR_RETURN(mesh.left_out_cells, receiver.Number(INT64_MAX));
  return mesh;
}

void SendFile(const CheckedMeshFile& file, PipeSender* sender) {
  sender->Text(file.path);
  sender->Number(static_cast<int64_t>(file.format));
  sender->Number(file.bytes);
}

absl::StatusOr<CheckedMeshFile> ReceiveFile(PipeReceiver* receiver) {
  CheckedMeshFile file;
  TF_ASSIGN_OR_RETURN(file.path, receiver->Text());
  TF_ASSIGN_OR_RETURN(const int64_t format,
                      receiver->Number(static_cast<int64_t>(MeshFormat::kVtp)));
  file.format = static_cast<MeshFormat>(format);
  TF_ASSIGN_OR_RETURN(file.bytes, receiver->Number(INT64_MAX));
  return file;
}

}  // namespace

absl::StatusOr<RawMesh> CallMeshReader(absl::string_view program, const CheckedMeshFile& file,
                                       const IsolationLimits& limits) {
  absl::StatusOr<RawMesh> mesh = absl::InternalError("not received");
  TF_RETURN_IF_ERROR(CallHelper(
      {program, kWhat, limits}, [&file](PipeSender* request) { SendFile(file, request); },
      [&mesh, &limits](int descriptor) {
        mesh = ReceiveRawMesh(descriptor, limits.max_memory_bytes);
        return mesh.status();
      }));
  return mesh;
}

int RunMeshReader(const std::function<absl::StatusOr<RawMesh>(const CheckedMeshFile& file)>& read) {
  return RunHelperProgram(
      [&read](const IsolationLimits& limits, PipeReceiver* request, PipeSender* answer) {
        absl::StatusOr<RawMesh> mesh = absl::InternalError("not read");
        const absl::Status status = WithoutExceptions(kWhat, limits, [&]() -> absl::Status {
          TF_ASSIGN_OR_RETURN(const CheckedMeshFile file, ReceiveFile(request));
          mesh = read(file);
          return mesh.status();
        });
        SendRawMesh(status.ok() ? mesh : status, answer);
      });
}

}  // namespace tissueform
