// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <future>
#include <random>
#include <string>

#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/support/byte_buffer.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"

// The first message of every call that takes a large one, changed at random bytes with fixed seeds.
// A change may leave it legal: what counts is that every call ends and that the server goes on.
namespace tissueform::testing {
namespace {

constexpr int kRounds = 300;

std::string Mutated(std::string bytes, std::mt19937* random) {
  const int changes = 1 + static_cast<int>((*random)() % 4);
  for (int i = 0; i < changes; ++i) {
    const size_t place = (*random)() % bytes.size();
    switch ((*random)() % 3) {
      case 0:
        bytes[place] = static_cast<char>((*random)());
        break;
      case 1:
        bytes.resize(1 + place);
        break;
      default:
        bytes.insert(place, 1 + (*random)() % 8, static_cast<char>((*random)()));
    }
  }
  return bytes;
}

class FirstMessageTest : public ServiceTest {
 protected:
  // Sends one raw message, half-closes and returns how the call ended.
  grpc::StatusCode CallWith(const std::string& method, const std::string& message) {
    if (stub_ == nullptr) {
      stub_ = std::make_unique<grpc::GenericStub>(OwnChannel());
    }
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    const grpc::Slice slice(message);
    const grpc::ByteBuffer request(&slice, 1);
    grpc::ByteBuffer response;
    std::promise<grpc::StatusCode> code;
    stub_->UnaryCall(&context, method, grpc::StubOptions(), &request, &response,
                     [&code](const grpc::Status& status) { code.set_value(status.error_code()); });
    return code.get_future().get();
  }

  void ExpectSurvives(const std::string& method, const std::string& good, uint32_t seed) {
    std::mt19937 random(seed);
    for (int round = 0; round < kRounds; ++round) {
      const grpc::StatusCode code = CallWith(method, Mutated(good, &random));
      EXPECT_NE(code, grpc::StatusCode::DEADLINE_EXCEEDED) << "round " << round;
      EXPECT_NE(code, grpc::StatusCode::UNAVAILABLE) << "round " << round;
      EXPECT_NE(code, grpc::StatusCode::UNKNOWN) << "round " << round;
    }
    ExpectServes();
  }

  const BarProblem problem_{11};

 private:
  std::unique_ptr<grpc::GenericStub> stub_;
};

TEST_F(FirstMessageTest, UploadMesh) {
  const std::vector<CellArray> arrays = problem_.CellArrays();
  const MeshPayloadView view =
      ViewMeshPayload(problem_.mesh.positions(), problem_.mesh.tets(), arrays);
  v1::UploadMeshRequest request;
  v1::MeshHeader* header = request.mutable_header();
  header->set_vertex_count(view.shape.num_vertices);
  header->set_tet_count(view.shape.num_tets);
  header->add_cell_arrays("youngs_modulus_pa");
  header->set_total_bytes(view.shape.TotalBytes());
  header->set_sha256(view.Sha256());
  ExpectSurvives("/tissueform.v1.MeshService/UploadMesh", request.SerializeAsString(), 1);
}

TEST_F(FirstMessageTest, CreateSession) {
  ServerOptions options = TestOptions();
  options.limits.max_sessions = 4;
  options.limits.session_idle_ttl = std::chrono::seconds(0);
  StartServer(options);
  const auto client = Connect();
  const auto mesh = client->UploadMesh(problem_.mesh, problem_.CellArrays());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  ExpectSurvives("/tissueform.v1.SessionService/CreateSession",
                 ToProto(problem_.Request(mesh->name())).SerializeAsString(), 2);
}

TEST_F(FirstMessageTest, Deform) {
  const auto client = Connect();
  v1::DeformRequest request;
  v1::DeformConfiguration* configuration = request.mutable_configuration();
  configuration->set_session(MakeSession(client.get(), problem_).name());
  configuration->mutable_vertices()->mutable_list()->add_vertices(3);
  configuration->set_encoding(v1::POSITION_ENCODING_FLOAT32);
  configuration->set_max_unacked(3);
  ExpectSurvives("/tissueform.v1.DeformService/Deform", request.SerializeAsString(), 3);
}

TEST_F(FirstMessageTest, DeformOnce) {
  const auto client = Connect();
  v1::DeformOnceRequest request;
  request.set_session(MakeSession(client.get(), problem_).name());
  *request.add_poses() = ToProto(TopPose(SomePose(1))[0]);
  ExpectSurvives("/tissueform.v1.DeformService/DeformOnce", request.SerializeAsString(), 4);
}

}  // namespace
}  // namespace tissueform::testing
