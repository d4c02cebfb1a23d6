// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/pipe_stream.h"

#include <fcntl.h>
#include <unistd.h>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

constexpr int64_t kMaxBytes = 1 << 16;

class PipeStreamTest : public ::testing::Test {
 protected:
  PipeStreamTest() { EXPECT_EQ(pipe2(ends_, O_CLOEXEC), 0); }
  ~PipeStreamTest() override {
    close(ends_[0]);
    EndSending();
  }
  PipeStreamTest(const PipeStreamTest&) = delete;
  PipeStreamTest& operator=(const PipeStreamTest&) = delete;

  void EndSending() {
    if (ends_[1] >= 0) close(ends_[1]);
    ends_[1] = -1;
  }

  PipeSender Sender() const { return PipeSender(ends_[1]); }
  PipeReceiver Receiver(int64_t most_bytes = kMaxBytes) const { return {ends_[0], most_bytes}; }

 private:
  int ends_[2] = {-1, -1};
};

TEST_F(PipeStreamTest, EverythingArrivesInItsOrder) {
  const Eigen::MatrixXd sent = Eigen::MatrixXd::Random(5, 3);
  PipeSender sender = Sender();
  sender.Number(7);
  sender.Text("seven");
  sender.Outcome(absl::NotFoundError("no eight"));
  sender.Entries(sent);
  ASSERT_TRUE(sender.ok());
  PipeReceiver receiver = Receiver();
  EXPECT_EQ(receiver.Number(10).value(), 7);
  EXPECT_EQ(receiver.Text().value(), "seven");
  EXPECT_EQ(receiver.Outcome(), absl::NotFoundError("no eight"));
  Eigen::MatrixXd received;
  ASSERT_THAT(receiver.Entries(3, &received), IsOk());
  EXPECT_EQ(received, sent);
}

TEST_F(PipeStreamTest, AnEndInTheMiddleIsDataLoss) {
  Sender().Number(3);  // rows of a matrix, and no more
  EndSending();
  Eigen::MatrixXd received;
  EXPECT_THAT(Receiver().Entries(3, &received),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("child process")));
}

TEST_F(PipeStreamTest, NumbersOutOfRangeAreDataLoss) {
  PipeSender sender = Sender();
  sender.Number(11);
  sender.Number(-1);
  PipeReceiver receiver = Receiver();
  EXPECT_THAT(receiver.Number(10),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("child process")));
  EXPECT_THAT(receiver.Number(10),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("child process")));
}

TEST_F(PipeStreamTest, AnotherNumberOfColumnsIsDataLoss) {
  Sender().Entries(Eigen::MatrixXd(Eigen::MatrixXd::Zero(2, 2)));
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> received;
  EXPECT_THAT(Receiver().Entries(3, &received),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("child process")));
}

TEST_F(PipeStreamTest, NoMoreThanAllowedIsReserved) {
  PipeSender sender = Sender();
  sender.Number(1 << 20);
  sender.Number(3);
  Eigen::MatrixXd received;
  EXPECT_THAT(Receiver().Entries(3, &received),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory limit")));
  EXPECT_EQ(received.size(), 0);
}

}  // namespace
}  // namespace tissueform
