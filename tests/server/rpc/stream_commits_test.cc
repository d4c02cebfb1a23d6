// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_commits.h"

#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<HandlePose> PosesOf(double z) {
  HandlePose pose;
  pose.translation_mm.z() = z;
  return {pose};
}

// The store answers when the test says so.
class StreamCommitsTest : public ::testing::Test {
 protected:
  struct Sent {
    double z = 0;
    StreamCommits::Outcome done;
  };

  std::vector<double> SentPoses() const {
    std::vector<double> poses;
    for (const Sent& sent : sent_) poses.push_back(sent.z);
    return poses;
  }

  std::vector<Sent> sent_;
  std::vector<uint64_t> answered_;
  StreamCommits commits_{[this](const std::shared_ptr<const Session>& /*session*/,
                                std::vector<HandlePose> poses, StreamCommits::Outcome done) {
                           sent_.push_back({poses[0].translation_mm.z(), std::move(done)});
                         },
                         [this](uint64_t sequence, const absl::Status& /*outcome*/) {
                           answered_.push_back(sequence);
                         }};
};

TEST_F(StreamCommitsTest, SendsOneAtATimeAndThenTheNewest) {
  commits_.StartNext(nullptr);
  EXPECT_FALSE(commits_.under_way());
  for (const uint64_t sequence : {1, 2, 3}) {
    commits_.Put(sequence, PosesOf(static_cast<double>(sequence)));
    commits_.StartNext(nullptr);
    EXPECT_TRUE(commits_.under_way());
  }
  EXPECT_THAT(SentPoses(), ElementsAre(1));
  sent_[0].done(absl::OkStatus());
  EXPECT_THAT(answered_, ElementsAre(1));
  const v1::DeformNotice notice = commits_.Finish(1, absl::OkStatus());
  EXPECT_EQ(notice.committed().sequence(), 1);
  EXPECT_EQ(notice.committed().failure(), "");
  EXPECT_FALSE(commits_.under_way());
  commits_.StartNext(nullptr);
  EXPECT_THAT(SentPoses(), ElementsAre(1, 3));
}

TEST_F(StreamCommitsTest, ReportsWhyACommitFailed) {
  commits_.Put(7, PosesOf(0));
  commits_.StartNext(nullptr);
  const v1::DeformNotice notice = commits_.Finish(7, absl::AbortedError("other handles"));
  EXPECT_EQ(notice.committed().sequence(), 7);
  EXPECT_EQ(notice.committed().failure(), "other handles");
}

TEST_F(StreamCommitsTest, AnAnswerAfterTheEndOfTheStreamGoesNowhere) {
  {
    StreamCommits commits(
        [this](const std::shared_ptr<const Session>& /*session*/,
               const std::vector<HandlePose>& /*poses*/, StreamCommits::Outcome done) {
          sent_.push_back({0, std::move(done)});
        },
        [this](uint64_t sequence, const absl::Status& /*outcome*/) {
          answered_.push_back(sequence);
        });
    commits.Put(1, PosesOf(0));
    commits.StartNext(nullptr);
    commits.Stop();
  }
  sent_[0].done(absl::OkStatus());
  EXPECT_THAT(answered_, IsEmpty());
}

}  // namespace
}  // namespace tissueform
