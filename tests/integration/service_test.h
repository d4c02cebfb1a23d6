// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "grpcpp/channel.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "core/base/error_reason.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "server/app/server_options.h"
#include "server/app/tissueform_server.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {

// A bar with its ends as regions: the lowest layer fixed, the highest one the handle "top".
struct BarProblem {
  // Different seeds give different meshes and stiffnesses.
  explicit BarProblem(uint32_t seed, const std::array<int, 3>& cells = {3, 3, 6});

  // What a client sends: the mesh with its stiffness as cell array "youngs_modulus_pa".
  std::vector<CellArray> CellArrays() const;
  SessionRequest Request(const std::string& mesh_name) const;
  // What the server must answer, from a deformer in this process.
  Positions Solve(const HandlePose& pose) const;

  TetMesh mesh;
  Eigen::VectorXd stiffness;
  ConstraintSet constraints;
};

// A turn about z with a shift; different for every `index`.
HandlePose SomePose(int index);
std::vector<NamedPose> TopPose(const HandlePose& pose);

// True as soon as `condition` holds; false when it does not within 30 s.
bool Eventually(const std::function<bool()>& condition);

// EXPECT_THAT(result, Because(ErrorReason::kMeshNotFound));
MATCHER_P(Because, reason, std::string(ReasonName(reason))) {
  *result_listener << GetStatus(arg).ToString();
  return HasReason(GetStatus(arg), reason);
}

// Float32 rounding of coordinates of this size, and a little more.
inline constexpr double kFloat32Tolerance = 1e-5;

// Starts a server in this process on a free port of loopback, before the first test needs it.
class ServiceTest : public ::testing::Test {
 protected:
  static ServerOptions TestOptions();

  // In place of a server with TestOptions().
  void StartServer(const ServerOptions& options, Authenticator* authenticator = nullptr);
  void StopServer() { server_.reset(); }
  TissueformServer& server();
  std::string address();

  std::unique_ptr<TissueformClient> Connect();
  // A connection that no other test or client shares.
  std::shared_ptr<grpc::Channel> OwnChannel();

  // Aborts the test program on errors.
  v1::Session MakeSession(TissueformClient* client, const BarProblem& problem);

  // The server still does its whole work, and rightly.
  void ExpectServes();

 private:
  std::unique_ptr<TissueformServer> server_;
};

}  // namespace tissueform::testing
