// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;

class SessionsTest : public ServiceTest {};

// The rest of it is compared by the model (ExpectedSession).
TEST_F(SessionsTest, ASessionReportsItsMeasurements) {
  const auto client = Connect();
  const v1::Session made = MakeSession(client.get(), BarProblem(1));
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client->GetSession(made.name()));
  EXPECT_GT(session.factor_bytes(), 0);
  EXPECT_GT(session.bytes_held(), session.factor_bytes());
  EXPECT_GE(session.seconds().factorise(), 0);
  EXPECT_LE(session.harmonic_min(), session.harmonic_max());
}

TEST_F(SessionsTest, EightSessionsAtOnceGiveEightRightAnswers) {
  constexpr int kSessions = 8;
  constexpr int kPoses = 5;
  std::vector<double> worst(kSessions, std::nan(""));
  std::vector<std::thread> threads;
  threads.reserve(kSessions);
  server();
  for (int s = 0; s < kSessions; ++s) {
    threads.emplace_back([this, s, &worst] {
      const BarProblem problem(100 + s, {3, 3, 4 + s % 3});
      const auto client = Connect();
      const v1::Session session = MakeSession(client.get(), problem);
      double error = 0;
      for (int i = 0; i < kPoses; ++i) {
        const HandlePose pose = SomePose(s + i);
        const auto answer = client->DeformOnce(session.name(), TopPose(pose));
        if (!answer.ok()) return;
        const auto positions = DecodePositions(answer->positions(), problem.mesh.num_vertices());
        if (!positions.ok()) return;
        error = std::max(error, (*positions - problem.Solve(pose)).cwiseAbs().maxCoeff());
      }
      worst[s] = error;
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (int s = 0; s < kSessions; ++s) {
    EXPECT_LT(worst[s], kFloat32Tolerance) << "session " << s;
  }
  EXPECT_EQ(server().sessions().table().size(), kSessions);
}

TEST_F(SessionsTest, TheSameMeshAgainIsNotSent) {
  const BarProblem problem(1);
  const auto client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh first,
                       client->UploadMesh(problem.mesh, problem.CellArrays()));
  const int64_t reserved = server().memory_budget().reserved_bytes();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh again,
                       client->UploadMesh(problem.mesh, problem.CellArrays()));
  EXPECT_EQ(first.name(), again.name());
  EXPECT_EQ(server().memory_budget().reserved_bytes(), reserved);
  EXPECT_THAT(first.cell_arrays(), ElementsAre("youngs_modulus_pa"));
  EXPECT_THAT(client->DeleteMesh(first.name()), IsOk());
  EXPECT_EQ(server().memory_budget().reserved_bytes(), 0);
}

TEST_F(SessionsTest, CancelledCreationsLeaveNothingBehind) {
  const BarProblem problem(1, {6, 6, 20});
  const auto client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client->UploadMesh(problem.mesh, problem.CellArrays()));
  const int64_t mesh_bytes = server().memory_budget().reserved_bytes();
  const auto stub = v1::SessionService::NewStub(OwnChannel());
  // Deadlines from "at once" to "after it is done": at no moment may anything be left. Only
  // an answer that was on its way when the client gave up leaves a session, which the client finds
  // again by its request id.
  SessionRequest request = problem.Request(mesh.name());
  std::vector<std::string> given_up;
  for (int milliseconds = 1; milliseconds <= 40; ++milliseconds) {
    request.request_id = absl::StrCat("attempt-", milliseconds);
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::milliseconds(milliseconds));
    v1::Session session;
    if (stub->CreateSession(&context, ToProto(request), &session).ok()) {
      EXPECT_THAT(client->DeleteSession(session.name()), IsOk());
    } else {
      given_up.push_back(request.request_id);
    }
  }
  EXPECT_FALSE(given_up.empty());
  for (const std::string& request_id : given_up) {
    request.request_id = request_id;
    ASSERT_OK_AND_ASSIGN(const v1::Session session, client->CreateSession(request));
    EXPECT_THAT(client->DeleteSession(session.name()), IsOk());
  }
  EXPECT_TRUE(Eventually([&] {
    return server().sessions().table().size() == 0 &&
           server().memory_budget().reserved_bytes() == mesh_bytes;
  })) << server().sessions().table().size()
      << " sessions, " << server().memory_budget().reserved_bytes() - mesh_bytes << " bytes left";
}

TEST_F(SessionsTest, AMeshMayBeDeletedUnderASession) {
  const BarProblem problem(1);
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem);
  ASSERT_THAT(client->DeleteMesh(session.mesh()), IsOk());
  EXPECT_THAT(client->DeformOnce(session.name(), TopPose(SomePose(1))), IsOk());
  ASSERT_THAT(client->DeleteSession(session.name()), IsOk());
  EXPECT_TRUE(Eventually([&] { return server().memory_budget().reserved_bytes() == 0; }));
}

}  // namespace
}  // namespace tissueform::testing
