// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

class WatchStreamTest : public ServiceTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
  }

  const BarProblem problem_{1};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
};

TEST_F(WatchStreamTest, AnotherClientSeesADragInItsVerticesAndEncoding) {
  const auto other = Connect();
  ASSERT_OK_AND_ASSIGN(const auto watch, other->Watch(session_, {}));
  const auto rest = watch->Receive();
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->origin(), v1::WATCH_ORIGIN_REST);
  ASSERT_THAT(watch->Ack(*rest), IsOk());
  DeformStream::Options options;
  options.vertices = {.kind = AnswerVertices::Kind::kList, .list = {7, 2, 40}};
  options.encoding = v1::POSITION_ENCODING_INT16_ZSTD;
  ASSERT_OK_AND_ASSIGN(const auto drag, client_->OpenStream(session_, options));
  for (int i = 1; i <= 5; ++i) {
    ASSERT_THAT(drag->SendPoses(i, TopPose(SomePose(i))), IsOk());
    const auto sent = drag->Receive();
    ASSERT_TRUE(sent.has_value());
    ASSERT_THAT(drag->Ack(*sent), IsOk());
    const auto seen = watch->Receive();
    ASSERT_TRUE(seen.has_value());
    EXPECT_EQ(seen->origin(), v1::WATCH_ORIGIN_DRAG);
    EXPECT_EQ(seen->frame().SerializeAsString(), sent->SerializeAsString());
    EXPECT_THAT(watch->form().vertices(), ::testing::ElementsAre(7, 2, 40));
    EXPECT_EQ(watch->form().encoding(), v1::POSITION_ENCODING_INT16_ZSTD);
    ASSERT_THAT(watch->Ack(*seen), IsOk());
  }
  drag->CloseSending();
  EXPECT_THAT(drag->Finish(), IsOk());
  ASSERT_THAT(client_->DeleteSession(session_), IsOk());
  EXPECT_FALSE(watch->Receive().has_value());
  const absl::Status end = watch->Finish();
  EXPECT_TRUE(HasReason(end, ErrorReason::kSessionNotFound)) << end;
  EXPECT_TRUE(Eventually([this] { return server().watches().size() == 0; }));
}

TEST_F(WatchStreamTest, DragIsNotifiedWhenAFollowerJoinsAndLeaves) {
  int followers = -1;
  DeformStream::Options options;
  options.on_notice = [&followers](const v1::DeformNotice& notice) {
    if (notice.has_followers()) followers = notice.followers().count();
  };
  ASSERT_OK_AND_ASSIGN(const auto drag, client_->OpenStream(session_, options));
  uint64_t sequence = 0;
  // Notices come with frames.
  const auto drags_until = [&](int expected) {
    return Eventually([&] {
      EXPECT_THAT(drag->SendPoses(++sequence, TopPose(SomePose(1))), IsOk());
      const auto frame = drag->Receive();
      if (frame.has_value()) {
        EXPECT_THAT(drag->Ack(*frame), IsOk());
      }
      return followers == expected;
    });
  };
  {
    const auto other = Connect();
    ASSERT_OK_AND_ASSIGN(const auto watch, other->Watch(session_, {}));
    EXPECT_TRUE(drags_until(1));
  }
  EXPECT_TRUE(drags_until(0)) << "a watch whose client is gone is no follower";
  drag->CloseSending();
  EXPECT_THAT(drag->Finish(), IsOk());
}

TEST_F(WatchStreamTest, DrainAnnouncesItsEndAndDoesNotWaitForWatchers) {
  std::optional<v1::DeformNotice> notice;
  WatchStream::Options options;
  options.on_notice = [&notice](const v1::DeformNotice& said) { notice = said; };
  ASSERT_OK_AND_ASSIGN(const auto watch, client_->Watch(session_, options));
  ASSERT_TRUE(watch->Receive().has_value());
  const auto before = std::chrono::system_clock::now().time_since_epoch();
  std::thread drain([this] { server().Drain(); });
  EXPECT_FALSE(watch->Receive().has_value());
  EXPECT_TRUE(HasReason(watch->Finish(), ErrorReason::kServerDraining));
  drain.join();
  ASSERT_TRUE(notice.has_value() && notice->has_draining());
  const auto seconds_away = notice->draining().end_time().seconds() -
                            std::chrono::duration_cast<std::chrono::seconds>(before).count();
  EXPECT_NEAR(static_cast<double>(seconds_away),
              static_cast<double>(TestOptions().drain_deadline.count()), 2);
}

}  // namespace
}  // namespace tissueform::testing
