// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/planning/plan_io.h"
#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform whoami`, `share` and `session link` as a real program with a real server.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

class AccessCommandTest : public ServedCliTest {
 protected:
  void SetUp() override {
    ServedCliTest::SetUp();
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(server_->address(), {}));
    ASSERT_OK_AND_ASSIGN(const Plan plan,
                         ReadPlan(SourcePath("tests/data/plans/tongue/plan.json")));
    ASSERT_OK_AND_ASSIGN(const PlanProblem problem, ResolvePlan(plan));
    ASSERT_OK_AND_ASSIGN(session_, PlanSession::Create(client_.get(), problem));
  }
  void TearDown() override {
    session_.reset();
    CliTest::TearDown();
  }

  ProcessResult Ask(std::vector<std::string> words) const {
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }

  std::unique_ptr<TissueformClient> client_;
  std::unique_ptr<PlanSession> session_;
};

TEST_F(AccessCommandTest, CallerIsUnnamedWithoutLogins) {
  const ProcessResult result = Ask({"whoami"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("(unnamed)"));
}

TEST_F(AccessCommandTest, ListsAShareUntilItIsRemoved) {
  const std::string name = session_->name();
  EXPECT_EQ(Ask({"share", "add", name, "ann", "--role", "planner"}).exit_code, 0);
  EXPECT_THAT(Ask({"share", "list", name}).out, AllOf(HasSubstr("ann"), HasSubstr("planner")));
  EXPECT_EQ(Ask({"share", "remove", name, "ann"}).exit_code, 0);
  EXPECT_THAT(Ask({"share", "list", name}).out, Not(HasSubstr("ann")));
  const ProcessResult again = Ask({"share", "remove", name, "ann"});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("no such share"));
  EXPECT_EQ(Ask({"share", "add", name, "ann", "--role", "owner"}).exit_code, 2);
}

TEST_F(AccessCommandTest, ALinkIsAllThatGoesToStdout) {
  const ProcessResult link = Ask({"session", "link", session_->name(), "--hours", "1"});
  EXPECT_EQ(link.exit_code, 0) << link.err;
  EXPECT_THAT(link.out, MatchesRegex("tfl_[A-Za-z0-9_-]+\n"));
  EXPECT_EQ(link.out.size(), 48U);
  EXPECT_EQ(Ask({"session", "unlink", session_->name()}).exit_code, 0);
  const ProcessResult none = Ask({"session", "link", "0123456789abcdef0123"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("no session"));
}

}  // namespace
}  // namespace tissueform::testing
