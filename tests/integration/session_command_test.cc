// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/planning/plan_io.h"
#include "tests/integration/served_cli_test.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform session update` as a real program with a real server.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kTonguePlan = SourcePath("tests/data/plans/tongue/plan.json");

class SessionCommandTest : public ServedCliTest {
 protected:
  void SetUp() override {
    ServedCliTest::SetUp();
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(server_->address(), {}));
    ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(kTonguePlan));
    ASSERT_OK_AND_ASSIGN(problem_, ResolvePlan(plan));
    ASSERT_OK_AND_ASSIGN(session_, PlanSession::Create(client_.get(), *problem_));
    const std::string text = BytesOfFile(kTonguePlan);
    Write("regions.json",
          absl::StrReplaceAll(
              text, {{"\"volumetricTongue.vtu\"",
                      "\"" + SourcePath("tests/data/plans/tongue/") + "volumetricTongue.vtu\""},
                     {"[-10, -10, -0.25]", "[-10, -10, -0.4]"},
                     {"\"tip\"", "\"front\""},
                     {"10, -2.6]", "10, -3]"},
                     {"15000", "2000"}}));
  }
  void TearDown() override {
    session_.reset();
    CliTest::TearDown();
  }

  ProcessResult Update(std::vector<std::string> words) const {
    words.insert(words.begin(), {"session", "update", session_->name()});
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }

  std::unique_ptr<TissueformClient> client_;
  std::optional<PlanProblem> problem_;
  std::unique_ptr<PlanSession> session_;
};

TEST_F(SessionCommandTest, RegionsComeFromAPlanAndNothingElseOfIt) {
  const ProcessResult updated = Update({"--regions", "regions.json", "--allow-outside"});
  EXPECT_THAT(updated, Succeeds());
  EXPECT_THAT(updated.out, HasSubstr("handles front"));
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client_->GetSession(session_->name()));
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(Path("regions.json"), {.allow_outside = true}));
  ASSERT_OK_AND_ASSIGN(const PlanProblem other, ResolvePlan(plan));
  EXPECT_THAT(session.handles(), ElementsAre("front"));
  ASSERT_NE(other.constraints.fixed().size(), problem_->constraints.fixed().size());
  EXPECT_EQ(session.fixed_vertex_count(), other.constraints.fixed().size());
  EXPECT_THAT(session.handle_vertex_counts(),
              ElementsAre(other.constraints.handles()[0].vertices.size()));
  EXPECT_NE(session.etag(), session_->description().etag());
  // Its answer is that of a deformer with those regions and the stiffness of before.
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client_->DeformOnce(session.name(), NamedPoses(other)));
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(answer.positions(), other.mesh->num_vertices()));
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateDeformer(*other.mesh, problem_->stiffness,
                                                           other.constraints, problem_->deformer));
  ASSERT_OK_AND_ASSIGN(const Deformation expected, deformer->Deform(other.poses));
  EXPECT_LT((positions - expected.positions).cwiseAbs().maxCoeff(), 1e-5);
}

TEST_F(SessionCommandTest, APlanOfAnotherMeshAndAStaleEtagAreRefused) {
  const std::string etag = session_->description().etag();
  EXPECT_THAT(Update({"--regions", SourcePath("tests/data/plans/bar/plan.json")}),
              FailsWith(1, AllOf(HasSubstr("the plan's mesh has"), HasSubstr("same mesh"))));
  EXPECT_THAT(Update({"--regions", "none.json"}), FailsWith(1, HasSubstr("none.json")));
  EXPECT_THAT(Update({"--regions", "regions.json", "--allow-outside", "--etag", "stale"}),
              FailsWith(1, HasSubstr("has changed")));
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client_->GetSession(session_->name()));
  EXPECT_EQ(session.etag(), etag);
  EXPECT_THAT(session.handles(), ElementsAre("tip"));
}

}  // namespace
}  // namespace tissueform::testing
