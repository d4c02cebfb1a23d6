// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// Everything that a client can say wrongly: the right code, a message that names the place, and a
// server that goes on. What is refused without a network in between is tested beside its code.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using Code = absl::StatusCode;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

absl::Status StatusOf(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

class BadInputTest : public ServiceTest {
 protected:
  void TearDown() override { ExpectServes(); }
};

// Uploads with raw messages.
class BadUploadTest : public BadInputTest {
 protected:
  using Messages = std::vector<v1::UploadMeshRequest>;

  // A header and one chunk, all right.
  Messages GoodMessages() const {
    const std::vector<CellArray> arrays = problem_.CellArrays();
    const MeshPayloadView view =
        ViewMeshPayload(problem_.mesh.positions(), problem_.mesh.tets(), arrays);
    Messages messages(2);
    v1::MeshHeader* header = messages[0].mutable_header();
    header->set_vertex_count(view.shape.num_vertices);
    header->set_tet_count(view.shape.num_tets);
    header->add_cell_arrays("youngs_modulus_pa");
    header->set_total_bytes(view.shape.TotalBytes());
    header->set_sha256(view.Sha256());
    for (const absl::string_view segment : view.segments) {
      messages[1].mutable_chunk()->mutable_data()->append(segment.data(), segment.size());
    }
    messages[1].mutable_chunk()->set_finish_write(true);
    return messages;
  }

  absl::Status Upload(const Messages& messages) {
    const auto stub = v1::MeshService::NewStub(OwnChannel());
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub->UploadMesh(&context, &response);
    for (const v1::UploadMeshRequest& message : messages) {
      if (!writer->Write(message)) break;
    }
    writer->WritesDone();
    return StatusOf(writer->Finish());
  }

  void ExpectRefused(const std::function<void(Messages&)>& change, Code code, const char* text) {
    Messages messages = GoodMessages();
    change(messages);
    EXPECT_THAT(Upload(messages), StatusIs(code, HasSubstr(text)));
    EXPECT_EQ(server().memory_budget().reserved_bytes(), 0) << text;
  }

  const BarProblem problem_{3};
};

TEST_F(BadUploadTest, GoodMessagesAreTaken) { EXPECT_THAT(Upload(GoodMessages()), IsOk()); }

TEST_F(BadUploadTest, InvalidHeaders) {
  ExpectRefused([](auto& m) { m[0].mutable_header()->set_vertex_count(5); }, Code::kInvalidArgument,
                "total_bytes");
  ExpectRefused([](auto& m) { m[0].mutable_header()->set_vertex_count(-5); },
                Code::kInvalidArgument, "vertex_count");
  ExpectRefused(
      [](auto& m) { m[0].mutable_header()->set_tet_count(std::numeric_limits<int64_t>::max()); },
      Code::kResourceExhausted, "--max-tets");
  ExpectRefused([](auto& m) { m[0].mutable_header()->set_sha256("zz"); }, Code::kInvalidArgument,
                "sha256");
}

TEST_F(BadUploadTest, MessagesOutOfOrder) {
  ExpectRefused([](auto& m) { m.erase(m.begin()); }, Code::kInvalidArgument,
                "first message must be the header");
  ExpectRefused([](auto& m) { m[0].Clear(); }, Code::kInvalidArgument,
                "first message must be the header");
  ExpectRefused([](auto& m) { m[1] = m[0]; }, Code::kInvalidArgument, "only chunks");
  ExpectRefused([](auto& m) { m.pop_back(); }, Code::kInvalidArgument, "finish_write");
  ExpectRefused([](auto& m) { m.clear(); }, Code::kInvalidArgument, "finish_write");
}

TEST_F(BadUploadTest, InvalidChunks) {
  ExpectRefused([](auto& m) { m[1].mutable_chunk()->set_write_offset(1); }, Code::kInvalidArgument,
                "without gaps");
  ExpectRefused([](auto& m) { m[1].mutable_chunk()->mutable_data()->push_back('x'); },
                Code::kInvalidArgument, "exceeds");
  ExpectRefused([](auto& m) { m[1].mutable_chunk()->mutable_data()->pop_back(); },
                Code::kInvalidArgument, "send the rest");
  ExpectRefused([](auto& m) { m[1].mutable_chunk()->set_finish_write(false); },
                Code::kInvalidArgument, "finish_write");
  ExpectRefused([](auto& m) { m[1].mutable_chunk()->mutable_data()->resize((1 << 20) + 1); },
                Code::kInvalidArgument, "1048576 at most");
}

TEST_F(BadUploadTest, AMessageOverTheTransportLimit) {
  Messages messages = GoodMessages();
  messages[1].mutable_chunk()->mutable_data()->resize(5 << 20);
  // gRPC's refusal and the end of the upload that follows from it race to the client.
  EXPECT_THAT(Upload(messages),
              AnyOf(StatusIs(Code::kResourceExhausted, HasSubstr("larger than")),
                    StatusIs(Code::kInvalidArgument, HasSubstr("1 MiB at most"))));
  EXPECT_TRUE(Eventually([this] { return server().memory_budget().reserved_bytes() == 0; }));
}

TEST_F(BadUploadTest, BytesThatWereDamagedOnTheirWay) {
  ExpectRefused([](auto& m) { (*m[1].mutable_chunk()->mutable_data())[11] ^= 1; }, Code::kDataLoss,
                "SHA-256");
}

TEST_F(BadInputTest, AMeshOverTheLimits) {
  ServerOptions options = TestOptions();
  options.limits.max_vertices = 150;
  StartServer(options);
  const BarProblem big(1, {4, 4, 8});
  EXPECT_THAT(Connect()->UploadMesh(big.mesh, {}),
              StatusIs(Code::kResourceExhausted, HasSubstr("--max-vertices")));
}

TEST_F(BadInputTest, MeshesThatNoDeformerCanUse) {
  const BarProblem good(4);
  const auto refused = [&](auto change, const char* text) {
    Positions positions = good.mesh.positions();
    TetIndices tets = good.mesh.tets();
    change(positions, tets);
    ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, tets));
    EXPECT_THAT(Connect()->UploadMesh(mesh, {}), StatusIs(Code::kInvalidArgument, HasSubstr(text)));
  };
  refused([](auto&, auto& tets) { std::swap(tets(5, 0), tets(5, 1)); }, "tet 5");
  refused(
      [](auto& positions, auto& tets) { positions.row(tets(0, 0)) = positions.row(tets(0, 1)); },
      "tet");
  refused([](auto& positions, auto&) { positions(6, 2) = kNan; }, "vertex 6");
  EXPECT_EQ(server().memory_budget().reserved_bytes(), 0);
}

// CreateSession with one thing wrong.
class BadSessionTest : public BadInputTest {
 protected:
  void ExpectRefused(const std::function<void(SessionRequest&)>& change, Code code,
                     const char* text) {
    const auto client = Connect();
    const auto mesh = client->UploadMesh(problem_.mesh, problem_.CellArrays());
    ASSERT_THAT(mesh, IsOk());
    const int64_t reserved = server().memory_budget().reserved_bytes();
    SessionRequest request = problem_.Request(mesh->name());
    change(request);
    EXPECT_THAT(client->CreateSession(request), StatusIs(code, HasSubstr(text)));
    EXPECT_EQ(server().memory_budget().reserved_bytes(), reserved) << text;
    EXPECT_EQ(server().sessions().table().size(), 0) << text;
  }

  const BarProblem problem_{5};
};

TEST_F(BadSessionTest, MeshesThatAreNotThere) {
  ExpectRefused([](auto& r) { r.mesh = "meshes/" + std::string(64, '0'); }, Code::kNotFound,
                "upload");
  ExpectRefused([](auto& r) { r.mesh = "face.vtu"; }, Code::kInvalidArgument, "invalid mesh name");
}

TEST_F(BadSessionTest, StiffnessThatIsNotPositive) {
  ExpectRefused([](auto& r) { r.stiffness = 0.0; }, Code::kInvalidArgument, "stiffness");
  ExpectRefused([](auto& r) { r.stiffness = -1.0; }, Code::kInvalidArgument, "stiffness");
  ExpectRefused([](auto& r) { r.stiffness = kNan; }, Code::kInvalidArgument, "stiffness");
  ExpectRefused([](auto& r) { r.stiffness = "density"; }, Code::kInvalidArgument, "\"density\"");
}

TEST_F(BadSessionTest, InvalidRegions) {
  ExpectRefused([](auto& r) { r.handles.clear(); }, Code::kInvalidArgument, "handle");
  ExpectRefused([](auto& r) { r.handles[0].vertices.clear(); }, Code::kInvalidArgument, "\"top\"");
  ExpectRefused([](auto& r) { r.handles[0].name.clear(); }, Code::kInvalidArgument, "name");
  ExpectRefused([](auto& r) { r.handles.push_back(r.handles[0]); }, Code::kInvalidArgument, "top");
  ExpectRefused([](auto& r) { r.handles[0].vertices = {100'000}; }, Code::kInvalidArgument,
                "100000");
  ExpectRefused([](auto& r) { r.fixed = {-1}; }, Code::kInvalidArgument, "-1");
  ExpectRefused([](auto& r) { r.fixed = {r.handles[0].vertices[0]}; }, Code::kInvalidArgument,
                "overlap");
  ExpectRefused([](auto& r) { r.handles[0].name = std::string(200, 'x'); }, Code::kInvalidArgument,
                "200 bytes");
}

TEST_F(BadSessionTest, AComponentWithoutConstraint) {
  // Two bars side by side, of which the second is held by nothing.
  const Eigen::Index vertices = problem_.mesh.num_vertices();
  const Eigen::Index tets = problem_.mesh.num_tets();
  Positions positions(2 * vertices, 3);
  positions << problem_.mesh.positions(),
      problem_.mesh.positions().rowwise() + Eigen::RowVector3d(50, 0, 0);
  TetIndices indices(2 * tets, 4);
  indices << problem_.mesh.tets(), problem_.mesh.tets().array() + static_cast<int32_t>(vertices);
  ASSERT_OK_AND_ASSIGN(const TetMesh pair, TetMesh::Create(positions, indices));
  const auto client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client->UploadMesh(pair, {}));
  SessionRequest request = problem_.Request(mesh.name());
  request.stiffness = 1000.0;
  EXPECT_THAT(client->CreateSession(request),
              StatusIs(Code::kInvalidArgument, HasSubstr("connected component")));
}

TEST_F(BadSessionTest, MoreMemoryThanTheBudgetHas) {
  ServerOptions options = TestOptions();
  options.memory_budget_bytes = 2 << 20;
  StartServer(options);
  const BarProblem big(6, {6, 6, 12});
  const auto client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client->UploadMesh(big.mesh, big.CellArrays()));
  EXPECT_THAT(client->CreateSession(big.Request(mesh.name())),
              StatusIs(Code::kResourceExhausted, AllOf(HasSubstr("MiB"), HasSubstr("2.0 MiB"))));
  EXPECT_EQ(server().memory_budget().reserved_bytes(), mesh.bytes_held());
}

// Poses with one thing wrong, both ways of sending them.
class BadPoseTest : public BadInputTest {
 protected:
  void ExpectRefused(const std::vector<NamedPose>& poses, Code code, const char* text) {
    const auto client = Connect();
    const v1::Session session = MakeSession(client.get(), problem_);
    EXPECT_THAT(client->DeformOnce(session.name(), poses), StatusIs(code, HasSubstr(text)));
    auto stream = client->OpenStream(session.name(), {});
    ASSERT_THAT(stream, IsOk());
    ASSERT_THAT((*stream)->SendPoses(1, poses), IsOk());
    EXPECT_FALSE((*stream)->Receive().has_value());
    EXPECT_THAT((*stream)->Finish(), StatusIs(code, HasSubstr(text)));
  }

  const BarProblem problem_{7};
};

TEST_F(BadPoseTest, UnknownHandleOrWrongNumber) {
  ExpectRefused({{"chin", {}}}, Code::kInvalidArgument, "no handle \"chin\"");
  ExpectRefused({}, Code::kInvalidArgument, "0 poses for 1");
  ExpectRefused({{"top", {}}, {"top", {}}}, Code::kInvalidArgument, "2 poses for 1");
}

TEST_F(BadPoseTest, InvalidPoseNumbers) {
  ExpectRefused(TopPose({.translation_mm = {0, kNan, 0}}), Code::kInvalidArgument, "translation");
  ExpectRefused(TopPose({.rotation_vector = {kInfinity, 0, 0}}), Code::kInvalidArgument,
                "rotation");
  ExpectRefused(TopPose({.scale = 0}), Code::kInvalidArgument, "scale");
  ExpectRefused(TopPose({.scale = -2}), Code::kInvalidArgument, "scale");
}

TEST_F(BadInputTest, UnknownSessions) {
  const auto client = Connect();
  const std::string name = "sessions/0123456789abcdef";
  EXPECT_THAT(client->GetSession(name), StatusIs(Code::kNotFound, HasSubstr(name)));
  EXPECT_THAT(client->DeleteSession(name), StatusIs(Code::kNotFound, HasSubstr(name)));
  EXPECT_THAT(client->DeformOnce(name, TopPose({})), StatusIs(Code::kNotFound, HasSubstr(name)));
  EXPECT_THAT(client->OpenStream(name, {}), StatusIs(Code::kNotFound, HasSubstr(name)));
  EXPECT_THAT(client->GetSession("mine"), StatusIs(Code::kInvalidArgument, HasSubstr("session")));
  EXPECT_THAT(client->DeleteSession(""), StatusIs(Code::kInvalidArgument, HasSubstr("session")));
}

// Streams with raw messages.
class BadStreamTest : public BadInputTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
    configuration_.mutable_configuration()->set_session(session_);
  }

  void ExpectRefused(const std::vector<v1::DeformRequest>& messages, Code code, const char* text) {
    const auto stub = v1::DeformService::NewStub(OwnChannel());
    grpc::ClientContext context;
    const auto call = stub->Deform(&context);
    for (const v1::DeformRequest& message : messages) {
      if (!call->Write(message)) break;
    }
    v1::DeformResponse dropped;
    while (call->Read(&dropped)) {
    }
    EXPECT_THAT(StatusOf(call->Finish()), StatusIs(code, HasSubstr(text)));
  }

  v1::DeformRequest Pose(uint64_t sequence) const {
    v1::DeformRequest request;
    request.mutable_pose()->set_sequence(sequence);
    *request.mutable_pose()->add_poses() = ToProto(TopPose(SomePose(1))[0]);
    return request;
  }
  static v1::DeformRequest Ack(uint64_t sequence) {
    v1::DeformRequest request;
    request.mutable_ack()->set_sequence(sequence);
    return request;
  }

  const BarProblem problem_{8};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
  v1::DeformRequest configuration_;
};

TEST_F(BadStreamTest, MessagesOutOfOrder) {
  ExpectRefused({Pose(1)}, Code::kInvalidArgument, "first message must be the configuration");
  ExpectRefused({v1::DeformRequest()}, Code::kInvalidArgument, "first message must be");
  ExpectRefused({configuration_, configuration_}, Code::kInvalidArgument, "second configuration");
  ExpectRefused({configuration_, v1::DeformRequest()}, Code::kInvalidArgument, "an empty message");
  ExpectRefused({configuration_, Pose(2), Pose(2)}, Code::kInvalidArgument, "sequence 2 after 2");
  ExpectRefused({configuration_, Pose(2), Pose(1)}, Code::kInvalidArgument, "sequence 1 after 2");
  ExpectRefused({configuration_, Ack(1)}, Code::kInvalidArgument,
                "frame 1, refinement 0, which was not sent");
}

TEST_F(BadStreamTest, AMessageOverTheTransportLimit) {
  v1::DeformRequest huge = Pose(1);
  huge.mutable_pose()->mutable_poses(0)->set_handle(std::string(5 << 20, 'x'));
  ExpectRefused({configuration_, huge}, Code::kResourceExhausted, "larger than");
  const auto client = Connect();
  EXPECT_THAT(client->DeformOnce(session_, {{std::string(5 << 20, 'x'), {}}}),
              StatusIs(Code::kResourceExhausted, HasSubstr("larger than")));
}

TEST_F(BadStreamTest, InvalidConfigurations) {
  const auto refused = [this](auto change, const char* text) {
    v1::DeformRequest request = configuration_;
    change(*request.mutable_configuration());
    ExpectRefused({request}, Code::kInvalidArgument, text);
  };
  refused([](auto& c) { c.set_max_unacked(0); }, "max_unacked is 0");
  refused([](auto& c) { c.set_max_unacked(65); }, "max_unacked is 65");
  refused([](auto& c) { c.set_encoding(static_cast<v1::PositionEncoding>(9)); }, "encoding 9");
  refused([](auto& c) { c.mutable_vertices()->mutable_list(); }, "empty");
  refused([](auto& c) { c.mutable_vertices()->mutable_list()->add_vertices(1 << 20); },
          "vertex 1048576");
  refused([](auto& c) { c.set_session("mine"); }, "invalid session name");
}

TEST_F(BadStreamTest, EndedBeforeItBegan) {
  const auto stub = v1::DeformService::NewStub(OwnChannel());
  grpc::ClientContext context;
  const auto call = stub->Deform(&context);
  call->WritesDone();
  v1::DeformResponse response;
  EXPECT_FALSE(call->Read(&response));
  EXPECT_THAT(StatusOf(call->Finish()),
              StatusIs(Code::kInvalidArgument, HasSubstr("before its configuration")));
}

}  // namespace
}  // namespace tissueform::testing
