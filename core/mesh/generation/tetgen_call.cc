// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/tetgen_call.h"

#include <string>
#include <type_traits>
#include <utility>

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "filling the surface with tets";

template <typename T>
void SendVector(const std::vector<T>& values, PipeSender* sender) {
  sender->Number(static_cast<int64_t>(values.size()));
  sender->Bytes(values.data(), values.size() * sizeof(T));
}

template <typename T>
absl::Status ReceiveVector(PipeReceiver* receiver, std::vector<T>* values) {
  constexpr auto kSize = static_cast<int64_t>(sizeof(T));
  TF_ASSIGN_OR_RETURN(const int64_t count, receiver->Number(INT64_MAX / kSize));
  TF_RETURN_IF_ERROR(receiver->Reserve(count, kSize));
  values->resize(static_cast<size_t>(count));
  return receiver->Bytes(values->data(), values->size() * sizeof(T));
}

// The numbers of the options as they lie in memory: both programs are of one build.
struct Quality {
  double max_radius_edge_ratio;
  double min_dihedral_deg;
  double max_tet_volume_mm3;
  int64_t keep_surface;
};

struct Request {
  Positions positions;
  TriangleIndices triangles;
  std::vector<Eigen::Vector3d> holes_mm;
  TetrahedralizationOptions options;
};

void SendRequest(const TriangleMesh& surface, const std::vector<Eigen::Vector3d>& holes_mm,
                 const TetrahedralizationOptions& options, PipeSender* sender) {
  const Quality quality{options.max_radius_edge_ratio, options.min_dihedral_deg,
                        options.max_tet_volume_mm3, options.keep_surface ? 1 : 0};
  sender->Entries(surface.positions());
  sender->Entries(surface.triangles());
  SendVector(holes_mm, sender);
  sender->Bytes(&quality, sizeof(quality));
  SendVector(options.edge_lengths_mm, sender);
  SendVector(options.regions, sender);
}

absl::StatusOr<Request> ReceiveRequest(PipeReceiver* receiver) {
  Request request;
  Quality quality{};
  TF_RETURN_IF_ERROR(receiver->Entries(3, &request.positions));
  TF_RETURN_IF_ERROR(receiver->Entries(3, &request.triangles));
  TF_RETURN_IF_ERROR(ReceiveVector(receiver, &request.holes_mm));
  TF_RETURN_IF_ERROR(receiver->Bytes(&quality, sizeof(quality)));
  request.options.max_radius_edge_ratio = quality.max_radius_edge_ratio;
  request.options.min_dihedral_deg = quality.min_dihedral_deg;
  request.options.max_tet_volume_mm3 = quality.max_tet_volume_mm3;
  request.options.keep_surface = quality.keep_surface != 0;
  TF_RETURN_IF_ERROR(ReceiveVector(receiver, &request.options.edge_lengths_mm));
  TF_RETURN_IF_ERROR(ReceiveVector(receiver, &request.options.regions));
  return request;
}

void SendTets(const absl::StatusOr<RawTets>& raw, PipeSender* sender) {
  sender->Outcome(raw.status());
  if (!raw.ok()) return;
  sender->Entries(raw->positions);
  sender->Entries(raw->tets);
  sender->Entries(raw->attributes);
}

absl::Status ReceiveTets(int descriptor, int64_t max_bytes, RawTets* raw) {
  PipeReceiver receiver(descriptor, max_bytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  TF_RETURN_IF_ERROR(receiver.Entries(3, &raw->positions));
  TF_RETURN_IF_ERROR(receiver.Entries(4, &raw->tets));
  return receiver.Entries(1, &raw->attributes);
}

}  // namespace

absl::StatusOr<RawTets> CallTetgen(const TriangleMesh& surface,
                                   const std::vector<Eigen::Vector3d>& holes_mm,
                                   const TetrahedralizationOptions& options) {
  RawTets raw;
  TF_RETURN_IF_ERROR(CallHelper(
      {kTetgenProgram, kWhat, options.limits},
      [&](PipeSender* request) { SendRequest(surface, holes_mm, options, request); },
      [&](int descriptor) {
        return ReceiveTets(descriptor, options.limits.max_memory_bytes, &raw);
      }));
  return raw;
}

int RunTetgenProgram(absl::StatusOr<RawTets> (*run)(const TriangleMesh& surface,
                                                    const std::vector<Eigen::Vector3d>& holes_mm,
                                                    const TetrahedralizationOptions& options)) {
  return RunHelperProgram(
      [run](const IsolationLimits& limits, PipeReceiver* receiver, PipeSender* answer) {
        absl::StatusOr<RawTets> raw = absl::InternalError("not run");
        const absl::Status status = WithoutExceptions(kWhat, limits, [&]() -> absl::Status {
          TF_ASSIGN_OR_RETURN(Request request, ReceiveRequest(receiver));
          TF_ASSIGN_OR_RETURN(
              const TriangleMesh surface,
              TriangleMesh::Create(std::move(request.positions), std::move(request.triangles)));
          raw = run(surface, request.holes_mm, request.options);
          return raw.status();
        });
        SendTets(status.ok() ? raw : status, answer);
      });
}

}  // namespace tissueform
