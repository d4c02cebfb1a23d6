// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/service_test.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "grpcpp/create_channel.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {
namespace {

template <typename T>
T ValueOrDie(absl::StatusOr<T> status_or) {
  if (!status_or.ok()) {
    std::fprintf(stderr, "test set-up failed: %s\n", status_or.status().ToString().c_str());
    std::abort();
  }
  return *std::move(status_or);
}

Eigen::VectorXd SomeStiffness(Eigen::Index num_tets, uint32_t seed) {
  std::mt19937 generator(seed);
  Eigen::VectorXd stiffness(num_tets);
  for (double& value : stiffness) {
    value = 1000.0 + generator() % 10'000;
  }
  return stiffness;
}

}  // namespace

BarProblem::BarProblem(uint32_t seed, const std::array<int, 3>& cells)
    : mesh(Bar(cells, 1.0, 0.2, seed)),
      stiffness(SomeStiffness(mesh.num_tets(), seed)),
      constraints(BarEnds(mesh, 0.5)) {}

std::vector<CellArray> BarProblem::CellArrays() const { return {{"youngs_modulus_pa", stiffness}}; }

SessionRequest BarProblem::Request(const std::string& mesh_name) const {
  SessionRequest request;
  request.mesh = mesh_name;
  request.stiffness = "youngs_modulus_pa";
  request.fixed = constraints.fixed();
  request.handles = constraints.handles();
  return request;
}

Positions BarProblem::Solve(const HandlePose& pose) const {
  const auto deformer = ValueOrDie(CreateDeformer(mesh, stiffness, constraints, {}));
  return ValueOrDie(deformer->Deform({pose})).positions;
}

HandlePose SomePose(int index) {
  return {.rotation_vector = {0.02 * index, 0, 0.3 + 0.1 * index},
          .pivot_mm = {1.5, 1.5, 6},
          .translation_mm = {0.1 * index, -0.2, 0.3},
          .scale = 1.0 + 0.01 * index};
}

std::vector<NamedPose> TopPose(const HandlePose& pose) { return {{"top", pose}}; }

bool Eventually(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) {
      return false;
    }
    std::this_thread::yield();
  }
  return true;
}

ServerOptions ServiceTest::TestOptions() {
  ServerOptions options;
  options.port = 0;
  options.workers = 2;
  options.memory_budget_bytes = int64_t{512} << 20;
  options.drain_deadline = std::chrono::seconds(10);
  return options;
}

void ServiceTest::StartServer(const ServerOptions& options, Authenticator* authenticator) {
  server_ = ValueOrDie(TissueformServer::Start(options, authenticator));
}

TissueformServer& ServiceTest::server() {
  if (server_ == nullptr) {
    StartServer(TestOptions());
  }
  return *server_;
}

std::string ServiceTest::address() { return absl::StrCat("127.0.0.1:", server().port()); }

std::unique_ptr<TissueformClient> ServiceTest::Connect() {
  TissueformClient::Options options;
  options.call_deadline = std::chrono::seconds(300);
  return ValueOrDie(TissueformClient::Connect(address(), options));
}

std::shared_ptr<grpc::Channel> ServiceTest::OwnChannel() {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetMaxReceiveMessageSize(-1);
  return grpc::CreateCustomChannel(address(), grpc::InsecureChannelCredentials(), arguments);
}

v1::Session ServiceTest::MakeSession(TissueformClient* client, const BarProblem& problem) {
  const v1::Mesh mesh = ValueOrDie(client->UploadMesh(problem.mesh, problem.CellArrays()));
  return ValueOrDie(client->CreateSession(problem.Request(mesh.name())));
}

void ServiceTest::ExpectServes() {
  const BarProblem problem(99);
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem);
  const auto answer = client->DeformOnce(session.name(), TopPose(SomePose(1)));
  ASSERT_TRUE(answer.ok()) << answer.status();
  const auto positions = DecodePositions(answer->positions(), problem.mesh.num_vertices());
  ASSERT_TRUE(positions.ok()) << positions.status();
  EXPECT_LT((*positions - problem.Solve(SomePose(1))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
  EXPECT_TRUE(client->DeleteSession(session.name()).ok());
}

}  // namespace tissueform::testing
