// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session.h"

#include <atomic>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::BarRecord;
using ::tissueform::testing::FakeClock;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::SampleMesh;
using ::tissueform::testing::StatusIs;
using ::tissueform::testing::Store;

using ::tissueform::testing::kInvalid;

HandlePose Turn(double degrees) {
  HandlePose pose;
  pose.rotation_vector = {0, 0, degrees * std::numbers::pi / 180};
  pose.translation_mm = {0.1, 0, 0.2};
  return pose;
}

// A session without registry. No job is posted, so this thread may stand for the strand.
class SessionTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::shared_ptr<Session>> Create(SessionRecord record,
                                                  const Cancellation& cancellation = {}) {
    record.id = "id";
    std::shared_ptr<SharedPreparation> preparation = preparations_.Find(record);
    return Session::Create(std::move(record), bar_, std::move(preparation), &budget_, &pool_,
                           &clock_, cancellation);
  }

  // As a stream does at its beginning, and then for a pose.
  static absl::StatusOr<std::optional<PreparedAnswer>> Respond(Session* session,
                                                               const ResponseRequest& request,
                                                               const HandlePose& pose) {
    TF_ASSIGN_OR_RETURN(const std::shared_ptr<PreparedAnswersRef> claim,
                        session->PrepareResponse(request, {}));
    return session->Respond(*claim, {pose});
  }

  FakeClock clock_;
  MemoryBudget budget_{256 << 20};
  MeshCatalog catalog_{{}, &budget_};
  WorkerPool pool_{1};
  SharedPreparations preparations_{&budget_, &pool_};
  const std::shared_ptr<const StoredMesh> bar_ = Store(SampleMesh(Bar({3, 3, 6})), &catalog_);
  const int64_t mesh_bytes_ = budget_.reserved_bytes();
};

TEST_F(SessionTest, MatchesItsRecord) {
  SessionRecord record = BarRecord(*bar_);
  record.model = DeformationModel::kArap;
  record.poisson_ratio = 0.3;
  record.gradient_field.max_iterations = 7;
  ASSERT_OK_AND_ASSIGN(const auto session, Create(record));
  EXPECT_EQ(session->id(), "id");
  EXPECT_EQ(&session->mesh(), bar_.get());
  EXPECT_EQ(session->model(), DeformationModel::kArap);
  EXPECT_EQ(session->poisson_ratio(), 0.3);
  EXPECT_EQ(session->gradient_field().max_iterations, 7);
  EXPECT_EQ(session->constraints().fixed(), record.fixed);
  ASSERT_EQ(session->constraints().handles().size(), 1);
  EXPECT_EQ(session->constraints().handles()[0].vertices, record.handles[0].vertices);
}

TEST_F(SessionTest, AnswersAsTheModelDoes) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kArap, DeformationModel::kLinearElastic,
        DeformationModel::kNeoHookean}) {
    SessionRecord record = BarRecord(*bar_);
    record.model = model;
    ASSERT_OK_AND_ASSIGN(const auto session, Create(record));
    ASSERT_OK_AND_ASSIGN(const Deformation answer, session->Solve(model, {Turn(10)}, {}));
    DeformerOptions options;
    options.model = model;
    ASSERT_OK_AND_ASSIGN(
        const auto deformer,
        CreateDeformer(bar_->mesh, bar_->FindCellArray("youngs_modulus_pa")->values,
                       session->constraints(), options));
    ASSERT_OK_AND_ASSIGN(const Deformation direct, deformer->Deform({Turn(10)}));
    EXPECT_EQ(answer.positions, direct.positions);
    session->Close(Session::CloseReason::kDeleted);
  }
}

TEST_F(SessionTest, TheSecondFactorOfASearchIsOfTheBudgetAndGivenBackWithTheAnswer) {
  SessionRecord record = BarRecord(*bar_);
  record.model = DeformationModel::kNeoHookean;
  ASSERT_OK_AND_ASSIGN(const auto session, Create(record));
  // Pushed so far together that L-BFGS alone stalls.
  HandlePose pose;
  pose.translation_mm = {2, 0, -4};
  const int64_t reserved = budget_.reserved_bytes();
  {
    ASSERT_OK_AND_ASSIGN(const MemoryReservation rest,
                         budget_.Reserve(budget_.limit_bytes() - reserved, "all the rest"));
    ASSERT_OK_AND_ASSIGN(const Deformation without, session->Solve(record.model, {pose}, {}));
    EXPECT_EQ(without.summary.newton_steps, 0);
  }
  ASSERT_OK_AND_ASSIGN(const Deformation answer, session->Solve(record.model, {pose}, {}));
  EXPECT_GT(answer.summary.newton_steps, 0);
  EXPECT_EQ(budget_.reserved_bytes(), reserved);
}

TEST_F(SessionTest, AUniformStiffnessIsAnArrayOfIt) {
  SessionRecord record = BarRecord(*bar_);
  ASSERT_OK_AND_ASSIGN(const auto by_array, Create(record));
  record.stiffness = 1000.0;  // what the array of the sample holds
  ASSERT_OK_AND_ASSIGN(const auto uniform, Create(record));
  ASSERT_OK_AND_ASSIGN(const Deformation a, by_array->Solve(record.model, {Turn(10)}, {}));
  ASSERT_OK_AND_ASSIGN(const Deformation b, uniform->Solve(record.model, {Turn(10)}, {}));
  EXPECT_EQ(a.positions, b.positions);
}

TEST_F(SessionTest, RefusesInvalidRecordsByNameAndReservesNothing) {
  const auto refused = [this](auto change, absl::StatusCode code, const char* text) {
    SessionRecord record = BarRecord(*bar_);
    change(record);
    EXPECT_THAT(Create(record), StatusIs(code, HasSubstr(text)));
    EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
  };
  refused([](SessionRecord& record) { record.stiffness = "density"; }, kInvalid, "\"density\"");
  refused([](SessionRecord& record) { record.stiffness = -1.0; }, kInvalid, "stiffness");
  refused([](SessionRecord& record) { record.fixed = {1'000'000}; }, kInvalid, "1000000");
  refused([](SessionRecord& record) { record.handles.push_back(record.handles[0]); }, kInvalid,
          "top");
  refused([](SessionRecord& record) { record.poisson_ratio = 0.5; }, kInvalid, "oisson");
}

TEST_F(SessionTest, ACancelledCreationLeavesNothingWhereverItStops) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kLinearElastic}) {
    SessionRecord record = BarRecord(*bar_);
    record.model = model;
    int stages = 0;
    for (int stop_at = 1;; ++stop_at) {
      stages = 0;
      const auto session = Create(record, Cancellation([&] { return ++stages == stop_at; }));
      if (session.ok()) break;
      ASSERT_THAT(session, StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
      EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
    }
    EXPECT_GE(stages, 3);
  }
}

TEST_F(SessionTest, AnotherModelIsMadeWhenItIsFirstAskedForAndKept) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  const int64_t own = session->bytes_held();
  EXPECT_THAT(session->PrepareModel(DeformationModel::kLinearElastic, {}), IsOk());
  const int64_t both = session->bytes_held();
  EXPECT_GT(both, own);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_ + both);
  EXPECT_THAT(session->PrepareModel(DeformationModel::kLinearElastic, {}), IsOk());
  EXPECT_THAT(session->Solve(DeformationModel::kGradientField, {Turn(1)}, {}), IsOk());
  EXPECT_EQ(session->bytes_held(), both) << "nothing is made twice";
  EXPECT_EQ(session->model(), DeformationModel::kGradientField) << "its own model stays";
}

TEST_F(SessionTest, PreparedAnswersAreNearTheDirectOnesOrNone) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  ResponseRequest request{.vertices = bar_->skin};
  request.tolerance_mm = 1e-3;
  request.max_rotation_rad = 0.4;
  ASSERT_OK_AND_ASSIGN(const std::optional<PreparedAnswer> answer,
                       Respond(session.get(), request, Turn(10)));
  ASSERT_TRUE(answer.has_value());
  EXPECT_TRUE(answer->summary.prepared);
  EXPECT_LE(answer->summary.error_bound_mm, 1e-3);
  ASSERT_OK_AND_ASSIGN(const Deformation direct,
                       session->Solve(DeformationModel::kGradientField, {Turn(10)}, {}));
  const Positions expected = direct.positions(bar_->skin, Eigen::all);
  EXPECT_LE((answer->positions.cast<double>() - expected).rowwise().norm().maxCoeff(), 1e-3);
  ASSERT_OK_AND_ASSIGN(const std::optional<PreparedAnswer> too_far,
                       Respond(session.get(), request, Turn(90)));
  EXPECT_FALSE(too_far.has_value()) << "not covered";
}

TEST_F(SessionTest, IllegalPosesAreRefused) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  HandlePose bad;
  bad.scale = -1;
  EXPECT_THAT(session->Solve(session->model(), {bad}, {}), StatusIs(kInvalid, HasSubstr("scale")));
  EXPECT_THAT(session->Solve(session->model(), {}, {}), StatusIs(kInvalid, HasSubstr("pose")));
}

TEST_F(SessionTest, AClosedSessionHoldsNothingAndAnswersNothing) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  session->Close(Session::CloseReason::kDeleted);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
  const auto closed = StatusIs(absl::StatusCode::kNotFound, HasSubstr("sessions/id"));
  EXPECT_THAT(session->Solve(session->model(), {Turn(1)}, {}), closed);
  EXPECT_THAT(session->PrepareModel(DeformationModel::kArap, {}), closed);
  EXPECT_THAT(Respond(session.get(), {.vertices = {0}}, Turn(1)), closed);
  session->Close(Session::CloseReason::kDeleted);  // does no harm
}

TEST_F(SessionTest, SecondEqualSessionNeedsATenthAndAnswersTheSame) {
  SessionRecord record = BarRecord(*bar_);
  record.model = DeformationModel::kLinearElastic;
  ASSERT_OK_AND_ASSIGN(const auto first, Create(record));
  const int64_t reserved = budget_.reserved_bytes() - mesh_bytes_;
  ASSERT_OK_AND_ASSIGN(const auto second, Create(record));
  const int64_t more = budget_.reserved_bytes() - mesh_bytes_ - reserved;
  EXPECT_EQ(more, second->bytes_held() - second->shared_bytes());
  EXPECT_LE(10 * more, reserved);
  ASSERT_OK_AND_ASSIGN(const Deformation a, first->Solve(record.model, {Turn(10)}, {}));
  first->Close(Session::CloseReason::kDeleted);
  ASSERT_OK_AND_ASSIGN(const Deformation b, second->Solve(record.model, {Turn(10)}, {}));
  EXPECT_EQ(a.positions, b.positions);
  second->Close(Session::CloseReason::kDeleted);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
}

TEST_F(SessionTest, AClosedSessionTakesThePreparedAnswersFromItsStreams) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<PreparedAnswersRef> claim,
                       session->PrepareResponse({.vertices = {0}}, {}));
  session->Close(Session::CloseReason::kDeleted);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
  EXPECT_THAT(session->Respond(*claim, {Turn(1)}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("sessions/id")));
}

TEST_F(SessionTest, SolveDoesNotPrepareAMissingModel) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  EXPECT_FALSE(session->HasModel(DeformationModel::kArap));
  EXPECT_THAT(session->Solve(DeformationModel::kArap, {Turn(1)}, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("prepared")));
  EXPECT_THAT(session->PrepareModel(DeformationModel::kArap, {}), IsOk());
  EXPECT_TRUE(session->HasModel(DeformationModel::kArap));
}

TEST_F(SessionTest, EveryUseIsRemembered) {
  ASSERT_OK_AND_ASSIGN(const auto session, Create(BarRecord(*bar_)));
  EXPECT_EQ(session->last_used(), clock_.Now());
  clock_.Advance(std::chrono::seconds(5));
  EXPECT_LT(session->last_used(), clock_.Now());
  EXPECT_THAT(session->Solve(session->model(), {Turn(1)}, {}), IsOk());
  EXPECT_EQ(session->last_used(), clock_.Now());
  clock_.Advance(std::chrono::seconds(5));
  EXPECT_THAT(Respond(session.get(), {.vertices = {0}}, Turn(1)), IsOk());
  EXPECT_EQ(session->last_used(), clock_.Now());
}

}  // namespace
}  // namespace tissueform
