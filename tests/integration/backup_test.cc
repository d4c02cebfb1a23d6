// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A running server is backed up and another one is started from the backup.

#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "core/base/process/child_process.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

// The exit code of tissueform-server with these words.
int RunServer(std::vector<std::string> arguments) {
  ChildOptions options;
  options.program = ProgramPath("tissueform-server");
  options.arguments = std::move(arguments);
  auto child = ChildProcess::Start(options);
  EXPECT_THAT(child, IsOk());
  return child.ok() ? (*child)->Wait().exit_code : -1;
}

class BackupProgramTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_THAT(server_.Start(), IsOk());
    fs::remove_all(backup_);
  }
  void TearDown() override { fs::remove_all(backup_); }

  std::string MakeSession(const DurableServer& server, uint32_t seed) const {
    const auto client = server.Connect();
    EXPECT_THAT(client, IsOk());
    const BarProblem bar(seed);
    const auto mesh = (*client)->UploadMesh(bar.mesh, bar.CellArrays());
    EXPECT_THAT(mesh, IsOk());
    const auto session = (*client)->CreateSession(bar.Request(mesh->name()));
    EXPECT_THAT(session, IsOk());
    return session.ok() ? session->name() : "";
  }

  // In place of what the server had; the folder stays as it was given out.
  static void Replace(const DurableServer& server, const std::string& backup) {
    for (const auto& entry : fs::directory_iterator(server.folder())) fs::remove_all(entry);
    ASSERT_EQ(RunServer({"restore", backup, "--data-dir", server.folder()}), 0);
  }

  DurableServer server_{"backup", {"--log-level", "warn"}};
  const std::string backup_ = server_.folder().string() + ".backup";
};

TEST_F(BackupProgramTest, ARestoredServerKnowsAllThatWasAcknowledgedBeforeTheBackupBegan) {
  std::vector<std::string> before;
  for (uint32_t seed = 1; seed <= 3; ++seed) before.push_back(MakeSession(server_, seed));
  std::thread others([&] {
    for (uint32_t seed = 10; seed < 16; ++seed) MakeSession(server_, seed);
  });
  EXPECT_EQ(RunServer({"backup", backup_, "--data-dir", server_.folder()}), 0);
  others.join();
  EXPECT_EQ(RunServer({"backup", "verify", backup_}), 0);
  ASSERT_THAT(server_.Kill(), IsOk());
  ASSERT_NO_FATAL_FAILURE(Replace(server_, backup_));
  ASSERT_THAT(server_.Start(), IsOk());
  const auto client = server_.Connect();
  ASSERT_THAT(client, IsOk());
  for (const std::string& name : before) {
    EXPECT_THAT((*client)->GetSession(name), IsOk());
    auto stream = (*client)->OpenStream(name, {});
    ASSERT_THAT(stream, IsOk());
    ASSERT_THAT((*stream)->SendPoses(1, TopPose(SomePose(1))), IsOk());
    EXPECT_TRUE((*stream)->Receive().has_value());
  }
}

TEST_F(BackupProgramTest, RestoredServerKeepsThePacsExport) {
  v1::Export before;
  {
    const auto client = server_.Connect();
    ASSERT_THAT(client, IsOk());
    const auto prediction =
        (*client)->predictions().Create(MakeSession(server_, 1), TopPose(SomePose(1)), {}, "",
                                        {.case_name = "cases/" + std::string(64, 'a')});
    ASSERT_THAT(prediction, IsOk());
    const auto made = (*client)->exports().Create(prediction->name());
    ASSERT_THAT(made, IsOk());
    v1::UpdateExportRequest request;
    request.set_name(made->name());
    request.set_state(v1::EXPORT_STATE_CONFIRMATION);
    request.set_detail("waits for a person");
    const auto changed = (*client)->exports().Update(request);
    ASSERT_THAT(changed, IsOk());
    before = *changed;
  }
  EXPECT_EQ(RunServer({"backup", backup_, "--data-dir", server_.folder()}), 0);
  ASSERT_THAT(server_.Kill(), IsOk());
  ASSERT_NO_FATAL_FAILURE(Replace(server_, backup_));
  ASSERT_THAT(server_.Start(), IsOk());
  const auto client = server_.Connect();
  ASSERT_THAT(client, IsOk());
  const auto after = (*client)->exports().Get(before.name());
  ASSERT_THAT(after, IsOk());
  EXPECT_EQ(after->DebugString(), before.DebugString());
  EXPECT_THAT((*client)->predictions().Get(before.prediction()), IsOk());
}

TEST_F(BackupProgramTest, WrongUseAndFailureHaveTheirExitCodes) {
  EXPECT_EQ(RunServer({"backup"}), 2);
  EXPECT_EQ(RunServer({"restore"}), 2);
  EXPECT_EQ(RunServer({"backup", "verify"}), 2);
  EXPECT_EQ(RunServer({"backup", backup_, "--in-memory"}), 1);
  EXPECT_EQ(RunServer({"backup", backup_, "--data-dir", "/nowhere"}), 1);
  EXPECT_EQ(RunServer({"backup", "verify", "/nowhere"}), 1);
  // Into the folder of a server that runs.
  ASSERT_EQ(RunServer({"backup", backup_, "--data-dir", server_.folder()}), 0);
  EXPECT_EQ(RunServer({"restore", backup_, "--data-dir", server_.folder()}), 1);
}

}  // namespace
}  // namespace tissueform::testing
