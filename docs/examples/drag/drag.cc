// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Drags one end of a bar 10 mm to the side through a tissueform-server, and prints where the middle
// goes:  drag HOST:PORT

#include <iostream>

#include "client/cpp/tissueform_client.h"
#include "core/mesh/bar_mesh.h"

using namespace tissueform;

absl::Status Drag(const char* address) {
  absl::StatusOr<TetMesh> bar = BarMesh(CubeGrid({4, 4, 12}, 5.0));  // 20 x 20 x 60 mm
  if (!bar.ok()) return bar.status();
  auto client = TissueformClient::Connect(address, {});
  if (!client.ok()) return client.status();
  const absl::StatusOr<v1::Mesh> mesh = (*client)->UploadMesh(*bar, {});
  if (!mesh.ok()) return mesh.status();

  // The lowest layer of 5 x 5 vertices stays, the highest moves; the server prepares what is
  // between.
  constexpr int kLayer = 25;
  const int last = static_cast<int>(bar->num_vertices()) - 1;
  SessionRequest request{.mesh = mesh->name(), .stiffness = 15'000.0, .handles = {{"top", {}}}};
  for (int i = 0; i < kLayer; ++i) {
    request.fixed.push_back(i);
    request.handles[0].vertices.push_back(last - i);
  }
  const absl::StatusOr<v1::Session> session = (*client)->CreateSession(request);
  if (!session.ok()) return session.status();

  // Frames hold the vertices that are asked for, here one in the middle of the bar.
  DeformStream::Options options;
  options.vertices = {AnswerVertices::Kind::kList, {last / 2}};
  auto stream = (*client)->OpenStream(session->name(), options);
  if (!stream.ok()) return stream.status();
  for (int step = 1; step <= 10; ++step) {
    const HandlePose pose{.translation_mm = {1.0 * step, 0, 0}};
    if (!(*stream)->SendPoses(step, {{"top", pose}}).ok()) break;  // Finish says why
    const std::optional<v1::DeformFrame> frame = (*stream)->Receive();
    if (!frame.has_value()) break;
    const absl::StatusOr<Positions> positions = DecodePositions(frame->positions(), 1);
    if (!positions.ok()) return positions.status();
    std::cout << "top " << step << " mm, middle at " << positions->row(0) << " mm" << std::endl;
    if (!(*stream)->Ack(*frame).ok()) break;
  }
  (*stream)->CloseSending();
  const absl::Status end = (*stream)->Finish();
  return end.ok() ? (*client)->DeleteSession(session->name()) : end;
}

int main(int argc, char** argv) {
  const absl::Status done =
      argc == 2 ? Drag(argv[1]) : absl::InvalidArgumentError("usage: drag HOST:PORT");
  if (!done.ok()) std::cerr << done << "\n";
  return done.ok() ? 0 : 1;
}
