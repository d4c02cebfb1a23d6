// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <memory>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/support/byte_buffer.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "client/cli/session/server_process.h"
#include "core/base/process/child_process.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/killed_starter.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// The real program: starts, prints its port, serves, drains.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience{60};

std::unique_ptr<ServerProcess> StartProgram(std::vector<std::string> arguments = {}) {
  arguments.insert(arguments.end(), {"--in-memory", "--port", "0", "--log-level", "warn"});
  auto process = ServerProcess::Start(ProgramPath("tissueform-server"), arguments, kPatience);
  EXPECT_THAT(process, IsOk());
  return process.ok() ? *std::move(process) : nullptr;
}

// What the standard health service says, as bytes: HealthCheckResponse{status}.
constexpr char kServing[] = "\x08\x01";
constexpr char kNotServing[] = "\x08\x02";

std::string Health(const std::string& address) {
  grpc::GenericStub stub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const grpc::Slice empty;
  const grpc::ByteBuffer request(&empty, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [&done](grpc::Status status) { done.set_value(std::move(status)); });
  const grpc::Status status = done.get_future().get();
  grpc::Slice bytes;
  if (!status.ok() || !response.DumpToSingleSlice(&bytes).ok()) {
    return status.error_message();
  }
  return {bytes.begin(), bytes.end()};
}

class ServerProgramTest : public ::testing::Test {
 protected:
  void SetUp() override {
    process_ = StartProgram();
    ASSERT_NE(process_, nullptr);
    auto client = TissueformClient::Connect(process_->address(), {});
    ASSERT_THAT(client, IsOk());
    client_ = *std::move(client);
  }

  std::string MakeSession() {
    const auto mesh = client_->UploadMesh(problem_.mesh, problem_.CellArrays());
    EXPECT_THAT(mesh, IsOk());
    const auto session = client_->CreateSession(problem_.Request(mesh.ok() ? mesh->name() : ""));
    EXPECT_THAT(session, IsOk());
    return session.ok() ? session->name() : "";
  }

  const BarProblem problem_{21};
  std::unique_ptr<ServerProcess> process_;
  std::unique_ptr<TissueformClient> client_;
};

TEST_F(ServerProgramTest, ExitsWithZeroWithoutActiveClients) {
  process_->Terminate();
  // Although an idle client stays connected.
  EXPECT_EQ(process_->WaitForExit(std::chrono::seconds(4)), 0);
}

TEST_F(ServerProgramTest, AnOpenStreamFinishesItsFramesWhileTheServerDrains) {
  auto stream = client_->OpenStream(MakeSession(), {});
  ASSERT_THAT(stream, IsOk());
  uint64_t sequence = 0;
  const auto drag = [&] {
    ASSERT_THAT((*stream)->SendPoses(++sequence, TopPose(SomePose(1))), IsOk());
    const auto frame = (*stream)->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->sequence(), sequence);
    ASSERT_THAT((*stream)->Ack(sequence), IsOk());
  };
  drag();
  EXPECT_EQ(Health(process_->address()), kServing);
  process_->Terminate();
  ASSERT_TRUE(Eventually([&] {
    drag();
    return (*stream)->server_is_draining() || ::testing::Test::HasFailure();
  }));
  EXPECT_THAT(client_->CreateSession({}),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("draining")));
  EXPECT_EQ(Health(process_->address()), kNotServing);
  for (int i = 0; i < 50; ++i) {
    drag();
  }
  EXPECT_FALSE(process_->WaitForExit(std::chrono::milliseconds(0)).has_value());
  (*stream)->CloseSending();
  EXPECT_FALSE((*stream)->Receive().has_value());
  EXPECT_THAT((*stream)->Finish(), IsOk());
  EXPECT_EQ(process_->WaitForExit(kPatience), 0);
}

// Not under the guard, which passes one signal on.
TEST(ServerSignalsTest, ASecondSignalDoesNotCutTheDrainOff) {
  ChildOptions options;
  options.program = ProgramPath("tissueform-server");
  options.arguments = {"--in-memory", "--port", "0", "--log-level", "warn"};
  options.output = ChildStream::Pipe();
  auto child = ChildProcess::Start(options);
  ASSERT_THAT(child, IsOk());
  std::string line;
  char byte = 0;
  while (byte != '\n' && read((*child)->answer(), &byte, 1) == 1) line += byte;
  const std::string address =
      line.substr(line.rfind(' ') + 1, line.find('\n') - line.rfind(' ') - 1);
  auto client = TissueformClient::Connect(address, {});
  ASSERT_THAT(client, IsOk());
  const BarProblem problem{21};
  const auto mesh = (*client)->UploadMesh(problem.mesh, problem.CellArrays());
  ASSERT_THAT(mesh, IsOk());
  const auto session = (*client)->CreateSession(problem.Request(mesh->name()));
  ASSERT_THAT(session, IsOk());
  auto stream = (*client)->OpenStream(session->name(), {});
  ASSERT_THAT(stream, IsOk());
  uint64_t sequence = 0;
  const auto drag = [&] {
    ASSERT_THAT((*stream)->SendPoses(++sequence, TopPose(SomePose(1))), IsOk());
    ASSERT_TRUE((*stream)->Receive().has_value());
    ASSERT_THAT((*stream)->Ack(sequence), IsOk());
  };
  (*child)->Signal(SIGTERM);
  ASSERT_TRUE(Eventually([&] {
    drag();
    return (*stream)->server_is_draining() || ::testing::Test::HasFailure();
  }));
  for (const int signal : {SIGTERM, SIGINT, SIGTERM}) {
    (*child)->Signal(signal);
    for (int i = 0; i < 10; ++i) drag();
  }
  (*stream)->CloseSending();
  EXPECT_FALSE((*stream)->Receive().has_value());
  EXPECT_THAT((*stream)->Finish(), IsOk());
  const ChildEnd end = (*child)->Wait();
  EXPECT_EQ(end.exit_code, 0) << "signal " << end.signal;
}

TEST_F(ServerProgramTest, CutsAnOpenStreamAtTheDrainDeadline) {
  process_ = StartProgram({"--drain-seconds", "0"});
  auto client = TissueformClient::Connect(process_->address(), {});
  ASSERT_THAT(client, IsOk());
  client_ = *std::move(client);
  auto stream = client_->OpenStream(MakeSession(), {});
  ASSERT_THAT(stream, IsOk());
  process_->Terminate();
  EXPECT_FALSE((*stream)->Receive().has_value());
  EXPECT_FALSE((*stream)->Finish().ok());
  EXPECT_EQ(process_->WaitForExit(kPatience), 0);
}

// A connection to 127.0.0.1:PORT; -1 when no process listens there.
int ConnectTo(const std::string& host_and_port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const std::string port = host_and_port.substr(host_and_port.rfind(':') + 1);
  address.sin_port = htons(static_cast<uint16_t>(std::atoi(port.c_str())));
  const int connection = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    return connection;
  }
  close(connection);
  return -1;
}

TEST(ServerProgramStartTest, ServerEndsWhenItsStarterIsKilled) {
  KilledStarter starter([] {
    const std::unique_ptr<ServerProcess>& kept = *new auto(StartProgram({"--host", "127.0.0.1"}));
    return kept == nullptr ? "" : kept->address();
  });
  const int connection = ConnectTo(starter.word());
  ASSERT_GE(connection, 0) << starter.word();
  starter.Kill();
  EXPECT_TRUE(Closes(connection));
  close(connection);
}

TEST(ServerProgramStartTest, AProgramThatIsNotThereIsNamed) {
  EXPECT_THAT(ServerProcess::Start("/nowhere/tissueform-server", {}, kPatience),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere/tissueform-server")));
}

TEST(ServerProgramStartTest, WrongUseEndsWithTwo) {
  const std::string command = ProgramPath("tissueform-server") + " --port 99999 2>/dev/null";
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
}

// What a program prints, and how it ends.
std::pair<std::string, int> OutputOf(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  std::string output;
  std::array<char, 256> part{};
  while (std::fgets(part.data(), part.size(), pipe) != nullptr) output += part.data();
  return {output, WEXITSTATUS(pclose(pipe))};
}

// For the whole process it would change the digits of sessions that come back from the store.
TEST(ServerProgramStartTest, ServerHasNoChoiceOfSolverThreads) {
  const std::string program = ProgramPath("tissueform-server");
  const auto [output, exit_code] = OutputOf(program + " --solver-threads 2");
  EXPECT_EQ(exit_code, 2);
  EXPECT_THAT(output, HasSubstr("--solver-threads"));
  EXPECT_EQ(OutputOf(program + " --help").first.find("solver-threads"), std::string::npos);
}

TEST_F(ServerProgramTest, ATakenPortOrFolderIsOneLineAndTheEnd) {
  const std::string& address = process_->address();
  const std::string port = address.substr(address.rfind(':') + 1);
  const DurableServer folder("taken");
  const std::string options =
      " --log-level off --data-dir " + folder.folder().string() + " --port ";
  const std::string program = ProgramPath("tissueform-server") + options;
  const auto [of_port, port_code] = OutputOf(program + port);
  EXPECT_EQ(port_code, 1);
  EXPECT_THAT(of_port, ::testing::StartsWith("tissueform-server: cannot listen on "));
  EXPECT_EQ(of_port.find('\n'), of_port.size() - 1) << of_port;

  ASSERT_OK_AND_ASSIGN(const auto holder,
                       ServerProcess::Start(ProgramPath("tissueform-server"),
                                            {"--log-level", "off", "--data-dir",
                                             folder.folder().string(), "--port", "0"},
                                            kPatience));
  const auto [of_folder, folder_code] = OutputOf(program + "0");
  EXPECT_EQ(folder_code, 1);
  EXPECT_THAT(of_folder, HasSubstr("another server"));
  EXPECT_EQ(of_folder.find('\n'), of_folder.size() - 1) << of_folder;
  EXPECT_THAT(client_->GetServerInfo(), IsOk()) << "who was there serves on";
  EXPECT_THAT(TissueformClient::Connect(holder->address(), {}), IsOk());
}

// gRPC 1.51 by itself never accepts a connection again after this (CVE-2023-4785).
TEST(ServerFloodTest, AFloodOfConnectionsLeavesAServerThatAnswersAndADragThatGoesOn) {
  auto process = ServerProcess::Start("/usr/bin/prlimit",
                                      {"--nofile=256:256", ProgramPath("tissueform-server"),
                                       "--in-memory", "--port", "0", "--log-level", "error"},
                                      kPatience);
  ASSERT_THAT(process, IsOk());
  const std::string& address = (*process)->address();
  ASSERT_OK_AND_ASSIGN(const auto client, TissueformClient::Connect(address, {}));
  const BarProblem problem(1);
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client->UploadMesh(problem.mesh, problem.CellArrays()));
  ASSERT_OK_AND_ASSIGN(const v1::Session session,
                       client->CreateSession(problem.Request(mesh.name())));
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  uint64_t sequence = 0;
  const auto goes_on = [&] {
    EXPECT_THAT(stream->SendPoses(++sequence, TopPose(SomePose(1))), IsOk());
    const auto frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_THAT(stream->Ack(*frame), IsOk());
  };
  for (int round = 0; round < 3; ++round) {
    std::vector<int> held;
    for (int i = 0; i < 400; ++i) {
      const int fd = ConnectTo(address);
      if (fd >= 0) held.push_back(fd);
    }
    goes_on();
    for (const int fd : held) close(fd);
    ASSERT_OK_AND_ASSIGN(const auto another,
                         TissueformClient::Connect(address, {.own_connection = true}));
    EXPECT_THAT(another->GetSession(session.name()), IsOk());
  }
  goes_on();
}

}  // namespace
}  // namespace tissueform::testing
