// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/connection_table.h"

#include <unistd.h>
#include <vector>

#include "gtest/gtest.h"
#include <sys/socket.h>

namespace tissueform {
namespace {

using Verdict = ConnectionTable::Verdict;

class ConnectionTableTest : public ::testing::Test {
 protected:
  ~ConnectionTableTest() override {
    for (const int fd : open_) close(fd);
  }

  int Socket() {
    open_.push_back(socket(AF_UNIX, SOCK_STREAM, 0));
    return open_.back();
  }
  void CloseFirst() {
    close(open_.front());
    open_.erase(open_.begin());
  }

  ConnectionTable table_{3, 2};
  std::vector<int> open_;
};

TEST_F(ConnectionTableTest, TakesAsManyAsItMayAndOfOneAddress) {
  EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTaken);
  EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTaken);
  EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTooManyOfAddress);
  EXPECT_EQ(table_.Take(Socket(), "b"), Verdict::kTaken);
  EXPECT_EQ(table_.Take(Socket(), "c"), Verdict::kTooMany);
  EXPECT_EQ(table_.size(), 3);
}

TEST_F(ConnectionTableTest, AClosedConnectionLeavesItsPlaceAlsoWhenItsNumberIsUsedAgain) {
  for (int i = 0; i < 2; ++i) EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTaken);
  for (int round = 0; round < 10; ++round) {
    CloseFirst();  // its number is the next one that the system gives
    const int again = Socket();
    EXPECT_EQ(table_.Take(again, "a"), Verdict::kTaken) << round;
    EXPECT_EQ(table_.size(), 2);
    EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTooManyOfAddress);
    close(open_.back());
    open_.pop_back();
  }
}

TEST_F(ConnectionTableTest, IgnoresADescriptorThatBecameAnotherFile) {
  for (int i = 0; i < 2; ++i) EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTaken);
  ASSERT_EQ(dup2(STDERR_FILENO, open_.front()), open_.front());
  EXPECT_EQ(table_.Take(Socket(), "a"), Verdict::kTaken);
  EXPECT_EQ(table_.size(), 2);
}

}  // namespace
}  // namespace tissueform
