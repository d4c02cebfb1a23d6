// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/wrap_call.h"

#include <utility>

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "wrapping the surface";

// As the numbers are in memory: both programs are from one build.
struct WrapSizes {
  double alpha_mm;
  double offset_mm;
};

absl::StatusOr<TriangleMesh> ReceiveMesh(PipeReceiver* receiver) {
  Positions positions;
  TriangleIndices triangles;
  TF_RETURN_IF_ERROR(receiver->Entries(3, &positions));
  TF_RETURN_IF_ERROR(receiver->Entries(3, &triangles));
  return TriangleMesh::Create(std::move(positions), std::move(triangles));
}

absl::StatusOr<TriangleMesh> ReceiveAnswer(int descriptor, int64_t max_bytes) {
  PipeReceiver receiver(descriptor, max_bytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  return ReceiveMesh(&receiver);
}

void SendMesh(const TriangleMesh& mesh, PipeSender* sender) {
  sender->Entries(mesh.positions());
  sender->Entries(mesh.triangles());
}

absl::StatusOr<TriangleMesh> Answer(AlphaWrapFunction wrap, PipeReceiver* receiver) {
  WrapSizes sizes{};
  TF_ASSIGN_OR_RETURN(const TriangleMesh surface, ReceiveMesh(receiver));
  TF_RETURN_IF_ERROR(receiver->Bytes(&sizes, sizeof(sizes)));
  return wrap(surface, sizes.alpha_mm, sizes.offset_mm);
}

}  // namespace

absl::StatusOr<TriangleMesh> CallAlphaWrap(const TriangleMesh& surface, double alpha_mm,
                                           double offset_mm, const IsolationLimits& limits) {
  const WrapSizes sizes{alpha_mm, offset_mm};
  absl::StatusOr<TriangleMesh> wrap = absl::InternalError("not run");
  TF_RETURN_IF_ERROR(CallHelper(
      {kWrapProgram, kWhat, limits},
      [&](PipeSender* request) {
        SendMesh(surface, request);
        request->Bytes(&sizes, sizeof(sizes));
      },
      [&](int descriptor) {
        wrap = ReceiveAnswer(descriptor, limits.max_memory_bytes);
        return wrap.status();
      }));
  return wrap;
}

int RunWrapProgram(AlphaWrapFunction wrap) {
  return RunHelperProgram(
      [wrap](const IsolationLimits& limits, PipeReceiver* receiver, PipeSender* answer) {
        absl::StatusOr<TriangleMesh> mesh = absl::InternalError("not run");
        const absl::Status status = WithoutExceptions(kWhat, limits, [&] {
          mesh = Answer(wrap, receiver);
          return mesh.status();
        });
        answer->Outcome(status);
        if (status.ok()) SendMesh(*mesh, answer);
      });
}

}  // namespace tissueform
