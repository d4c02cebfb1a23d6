// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/tet_topology.h"
#include "proto/conversion/geometry_conversion.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tissueform/v1/plan_service.grpc.pb.h"

// A wanted face asked for over the network.
namespace tissueform::testing {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr double kDegree = 3.14159265358979323846 / 180;

v1::Vector3 Vector(const Eigen::Vector3d& from) {
  v1::Vector3 vector;
  vector.set_x(from.x());
  vector.set_y(from.y());
  vector.set_z(from.z());
  return vector;
}

v1::FitRange Range(double most) {
  v1::FitRange range;
  range.set_lowest(-most);
  range.set_highest(most);
  return range;
}

v1::FitRanges Ranges(double most) {
  v1::FitRanges ranges;
  *ranges.mutable_x() = *ranges.mutable_y() = *ranges.mutable_z() = Range(most);
  return ranges;
}

class PlanServiceTest : public ServiceTest {
 protected:
  PlanServiceTest()
      : client_(Connect()),
        session_(MakeSession(client_.get(), problem_)),
        stub_(v1::PlanService::NewStub(OwnChannel())) {}

  // Skin points, spread over the bar, are to go where this pose of its top brings them.
  v1::FitRequest Wanted(const HandlePose& pose, size_t count = 10) const {
    const Positions positions = problem_.Solve(pose);
    std::vector<int32_t> skin = BoundaryVertices(problem_.mesh);
    const std::vector<int32_t>& held = problem_.constraints.constrained();
    std::erase_if(skin, [&](int32_t v) { return std::binary_search(held.begin(), held.end(), v); });
    v1::FitRequest request;
    request.set_session(session_.name());
    for (size_t k = 0; k < count; ++k) {
      const int32_t v = skin[(2 * k + 1) * skin.size() / (2 * count)];
      v1::FitTarget* target = request.add_targets();
      target->set_name("point " + std::to_string(k));
      *target->mutable_point_mm() = Vector(problem_.mesh.positions().row(v));
      *target->mutable_position_mm() = Vector(positions.row(v));
    }
    v1::FitFreedom* freedom = request.add_freedoms();
    freedom->set_handle("top");
    *freedom->mutable_rotation_vector() = Ranges(20 * kDegree);
    *freedom->mutable_translation_mm() = Ranges(5);
    request.set_less_movement(1e-4);
    return request;
  }

  absl::StatusOr<v1::FitResponse> Fit(
      const v1::FitRequest& request, std::chrono::microseconds patience = std::chrono::minutes(1)) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + patience);
    v1::FitResponse response;
    const grpc::Status status = stub_->Fit(&context, request, &response);
    if (!status.ok()) {
      return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                          status.error_message());
    }
    return response;
  }

  absl::Status Refusal(const v1::FitRequest& request) { return Fit(request).status(); }

  const BarProblem problem_{7, {4, 4, 8}};
  const std::unique_ptr<TissueformClient> client_;
  const v1::Session session_;
  const std::unique_ptr<v1::PlanService::Stub> stub_;
};

// Where a pose brings the handle, which says all of it: fitted poses turn about another pivot.
Positions Moved(const BarProblem& problem, const HandlePose& pose) {
  const std::vector<int32_t>& vertices = problem.constraints.handles()[0].vertices;
  Positions moved = problem.mesh.positions()(vertices, Eigen::all);
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    moved.row(v) = ApplyPose(pose, Eigen::Vector3d(moved.row(v)));
  }
  return moved;
}

TEST_F(PlanServiceTest, AKnownPoseIsFoundAgain) {
  HandlePose known = SomePose(1);
  known.rotation_vector = Eigen::Vector3d(0.05, -0.1, 0.08);
  known.scale = 1;
  ASSERT_OK_AND_ASSIGN(const v1::FitResponse fit, Fit(Wanted(known)));
  EXPECT_TRUE(fit.converged());
  ASSERT_EQ(fit.poses_size(), 1);
  const HandlePose found = ToNamedPose(fit.poses(0)).pose;
  EXPECT_LT((Moved(problem_, found) - Moved(problem_, known)).cwiseAbs().maxCoeff(), 0.01);
  ASSERT_EQ(fit.numbers_size(), 6);
  EXPECT_GT(fit.numbers(0).by_targets(), 0.99);
  ASSERT_EQ(fit.targets_size(), 10);
  for (const v1::FittedTarget& target : fit.targets()) EXPECT_TRUE(target.reached());
  EXPECT_EQ(fit.contradictions_size(), 0);
}

TEST_F(PlanServiceTest, VerifiedFitUsesTheModelItself) {
  v1::FitRequest request = Wanted(SomePose(2));
  request.set_model(v1::DEFORMATION_MODEL_NEO_HOOKEAN);
  request.set_verify(true);
  ASSERT_OK_AND_ASSIGN(const v1::FitResponse fit, Fit(request));
  EXPECT_TRUE(fit.model_converged());
  EXPECT_GT(fit.prepared_error_mm(), 0);
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client_->DeformOnce(session_.name(), TopPose(ToNamedPose(fit.poses(0)).pose),
                                           {}, v1::DEFORMATION_MODEL_NEO_HOOKEAN));
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(answer.positions(), problem_.mesh.num_vertices()));
  for (int k = 0; k < fit.targets_size(); ++k) {
    const v1::Vector3& reported = fit.targets(k).position_mm();
    // The point is a vertex: it is where the session says that vertex is.
    const auto nearest =
        (positions.rowwise() - Eigen::RowVector3d(reported.x(), reported.y(), reported.z()))
            .rowwise()
            .norm()
            .minCoeff();
    EXPECT_LT(nearest, 1e-3) << fit.targets(k).name();
  }
}

TEST_F(PlanServiceTest, OtherTargetsOfTheSamePointsTakeNoMoreMemory) {
  const auto bytes_held = [&] { return client_->GetSession(session_.name())->bytes_held(); };
  ASSERT_THAT(Fit(Wanted(SomePose(1))), IsOk());
  const int64_t once = bytes_held();
  ASSERT_THAT(Fit(Wanted(SomePose(2))), IsOk());
  EXPECT_EQ(bytes_held(), once);
  ASSERT_THAT(Fit(Wanted(SomePose(2), 6)), IsOk());
  EXPECT_GT(bytes_held(), once);  // other points
}

TEST_F(PlanServiceTest, ReportsTargetsThatCannotBeReached) {
  v1::FitRequest request = Wanted(SomePose(1), 2);
  for (v1::FitTarget& target : *request.mutable_targets()) {
    *target.mutable_displacement_mm() = Vector({0, 0, 100});
  }
  ASSERT_OK_AND_ASSIGN(const v1::FitResponse fit, Fit(request));
  EXPECT_FALSE(fit.targets(0).reached());
  EXPECT_GT(fit.targets(0).missed_mm(), 90);
  const auto upward = std::find_if(
      fit.numbers().begin(), fit.numbers().end(),
      [](const v1::FittedNumber& number) { return !number.is_rotation() && number.axis() == 2; });
  ASSERT_NE(upward, fit.numbers().end());
  EXPECT_EQ(upward->bound(), v1::FIT_BOUND_HIGHEST);
  EXPECT_NEAR(upward->value(), 5, 1e-9);
}

TEST_F(PlanServiceTest, BadRequestsAreRefusedInALineThatNamesTheCulprit) {
  using enum absl::StatusCode;
  const v1::FitRequest good = Wanted(SomePose(1), 2);
  const auto with = [&](const auto& change) {
    v1::FitRequest request = good;
    change(&request);
    return Refusal(request);
  };
  EXPECT_THAT(with([](auto* r) { r->set_session("nobody"); }), StatusIs(kInvalidArgument));
  EXPECT_THAT(with([](auto* r) { r->set_session("sessions/0123456789abcdef"); }),
              StatusIs(kNotFound));
  EXPECT_THAT(with([](auto* r) { r->clear_targets(); }),
              StatusIs(kInvalidArgument, HasSubstr("no targets")));
  EXPECT_THAT(with([](auto* r) { r->clear_freedoms(); }),
              StatusIs(kInvalidArgument, HasSubstr("no free numbers")));
  EXPECT_THAT(with([](auto* r) { r->mutable_targets(1)->clear_position_mm(); }),
              StatusIs(kInvalidArgument, HasSubstr("\"point 1\" has no goal")));
  EXPECT_THAT(with([](auto* r) { r->mutable_targets(1)->clear_point_mm(); }),
              StatusIs(kInvalidArgument, HasSubstr("\"point 1\" has no position")));
  EXPECT_THAT(with([](auto* r) { r->mutable_targets(1)->set_name("point 0"); }),
              StatusIs(kInvalidArgument, HasSubstr("name is not unique")));
  EXPECT_THAT(with([](auto* r) { r->mutable_targets(0)->mutable_point_mm()->set_x(500); }),
              StatusIs(kInvalidArgument, HasSubstr("off the skin")));
  EXPECT_THAT(with([](auto* r) {
                r->mutable_targets(0)->mutable_position_mm()->set_x(
                    std::numeric_limits<double>::quiet_NaN());
              }),
              StatusIs(kInvalidArgument, HasSubstr("NaN")));
  EXPECT_THAT(with([](auto* r) { r->mutable_freedoms(0)->set_handle("nose"); }),
              StatusIs(kInvalidArgument, HasSubstr("no such handle")));
  EXPECT_THAT(with([](auto* r) { *r->add_freedoms() = r->freedoms(0); }),
              StatusIs(kInvalidArgument, HasSubstr("listed twice")));
  EXPECT_THAT(with([](auto* r) {
                r->mutable_freedoms(0)->mutable_translation_mm()->mutable_x()->set_lowest(9);
              }),
              StatusIs(kInvalidArgument, HasSubstr("are reversed")));
  EXPECT_THAT(with([](auto* r) { r->set_model(v1::DEFORMATION_MODEL_ARAP); }),
              StatusIs(kInvalidArgument, HasSubstr("no prepared answers")));
  EXPECT_THAT(with([](auto* r) {
                r->add_poses()->set_handle("top");
                r->mutable_poses(0)->set_scale(1.1);
              }),
              StatusIs(kInvalidArgument, HasSubstr("scale")));
  EXPECT_THAT(with([](auto* r) {
                auto* list = r->mutable_targets(0)->mutable_vertices()->mutable_vertices();
                list->Resize(20001, 1);
              }),
              StatusIs(kInvalidArgument, HasSubstr("20000")));
  EXPECT_THAT(Fit(good), IsOk());
}

TEST_F(PlanServiceTest, AbandonedFitEndsAndLeavesTheSessionUnchanged) {
  // One deadline could find every fit already done; ever shorter ones end fits wherever they are.
  constexpr int kFits = 50;
  int ended = 0;
  for (int fit = 0; fit < kFits; ++fit) {
    const absl::Status status =
        Fit(Wanted(SomePose(1)), std::chrono::microseconds(1000 / (fit + 1))).status();
    EXPECT_THAT(status.code(), AnyOf(absl::StatusCode::kOk, absl::StatusCode::kDeadlineExceeded));
    ended += status.ok() ? 0 : 1;
  }
  EXPECT_GT(ended, 0);
  EXPECT_THAT(Fit(Wanted(SomePose(1))), IsOk());
}

}  // namespace
}  // namespace tissueform::testing
