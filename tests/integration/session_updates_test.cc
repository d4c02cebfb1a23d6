// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// UpdateSession over the network, and what open drags see of it.
namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SessionUpdatesTest : public ServiceTest {
 protected:
  v1::UpdateSessionRequest ToElastic(const v1::Session& session) {
    v1::UpdateSessionRequest request;
    request.set_name(session.name());
    request.set_etag(session.etag());
    request.set_model(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
    request.mutable_stiffness()->set_uniform_pa(9000);
    request.set_poisson_ratio(0.3);
    return request;
  }

  v1::UpdateSessionRequest ToOtherHandle(const v1::Session& session) {
    v1::UpdateSessionRequest request;
    request.set_name(session.name());
    v1::SessionRegions* regions = request.mutable_regions();
    const SessionRequest before = problem_.Request("");
    regions->mutable_fixed_vertices()->Add(before.fixed.begin(), before.fixed.end());
    v1::Handle* handle = regions->add_handles();
    handle->set_name("crown");
    const std::vector<int32_t>& vertices = before.handles[0].vertices;
    handle->mutable_vertices()->Add(vertices.begin(), vertices.end());
    return request;
  }

  const BarProblem problem_{3};
};

TEST_F(SessionUpdatesTest, AnOpenDragGoesOnWithTheUpdatedSession) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  std::vector<v1::DeformNotice::NoticeCase> notices;
  DeformStream::Options options;
  options.on_notice = [&notices](const v1::DeformNotice& notice) {
    notices.push_back(notice.notice_case());
  };
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), options));
  ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  std::optional<v1::DeformFrame> frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  ASSERT_THAT(stream->Ack(*frame), IsOk());
  ASSERT_THAT(client->UpdateSession(ToElastic(session)), IsOk());
  ASSERT_THAT(stream->SendPoses(2, TopPose(SomePose(3))), IsOk());
  frame = stream->Receive();
  ASSERT_TRUE(frame.has_value()) << stream->Finish();
  EXPECT_EQ(frame->sequence(), 2U);
  EXPECT_THAT(notices, ElementsAre(v1::DeformNotice::kUpdated));
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client->DeformOnce(session.name(), TopPose(SomePose(3))));
  EXPECT_TRUE(frame->positions() == answer.positions()) << "that of the new model";
}

TEST_F(SessionUpdatesTest, OtherHandlesEndADragWithAReason) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  ASSERT_OK_AND_ASSIGN(const v1::Session after, client->UpdateSession(ToOtherHandle(session)));
  EXPECT_THAT(after.handles(), ElementsAre("crown"));
  ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  EXPECT_FALSE(stream->Receive().has_value());
  const absl::Status end = stream->Finish();
  EXPECT_EQ(end.code(), absl::StatusCode::kAborted);
  EXPECT_TRUE(HasReason(end, ErrorReason::kSessionUpdated)) << end;
  EXPECT_THAT(client->DeformOnce(session.name(), {{"crown", SomePose(1)}}), IsOk());
}

TEST_F(SessionUpdatesTest, RefusedUpdateSaysWhyAndChangesNothing) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  v1::UpdateSessionRequest request;
  request.set_name(session.name());
  EXPECT_THAT(client->UpdateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("changes nothing")));
  request = ToElastic(session);
  request.mutable_stiffness()->set_cell_array("none of that name");
  EXPECT_THAT(client->UpdateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("none of that name")));
  request = ToOtherHandle(session);
  request.mutable_regions()->mutable_handles(0)->set_vertices(0, 1 << 20);
  EXPECT_THAT(client->UpdateSession(request), StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(client->GetSession(session.name())->etag(), session.etag());
}

}  // namespace
}  // namespace tissueform::testing
