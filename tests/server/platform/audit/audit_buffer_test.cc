// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_buffer.h"

#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using testing::StatusIs;

class AuditBufferTest : public ::testing::Test {
 protected:
  std::unique_ptr<AuditBuffer> Open(int64_t max_bytes = 1000) const {
    auto buffer = AuditBuffer::Open(path_, max_bytes);
    EXPECT_THAT(buffer, IsOk());
    return *std::move(buffer);
  }
  static std::vector<std::string> Texts(AuditBuffer* buffer, int64_t after = 0) {
    std::vector<std::string> texts;
    auto messages = buffer->Read(after, 100);
    EXPECT_THAT(messages, IsOk());
    for (const AuditBuffer::Message& message : *messages) texts.push_back(message.text);
    return texts;
  }

  const std::string path_ =
      testing::EmptyTestFolder(std::string("audit_buffer_") +
                               ::testing::UnitTest::GetInstance()->current_test_info()->name()) /
      "buffer.db";
};

TEST_F(AuditBufferTest, KeepsMessagesInOrderAndTheirNumbersOverARestart) {
  std::deque<std::string> messages = {"one", "two", "three"};
  auto buffer = Open();
  EXPECT_THAT(buffer->Append(&messages), IsOk());
  EXPECT_THAT(messages, IsEmpty());
  EXPECT_THAT(buffer->Remove(3), IsOk());
  buffer.reset();
  buffer = Open();
  messages = {"four"};
  EXPECT_THAT(buffer->Append(&messages), IsOk());
  const auto kept = buffer->Read(0, 100);
  ASSERT_THAT(kept, IsOk());
  ASSERT_EQ(kept->size(), 1);
  EXPECT_EQ(kept->front().number, 4);
  EXPECT_EQ(kept->front().text, "four");
}

TEST_F(AuditBufferTest, ReadsAfterANumberUpToACount) {
  std::deque<std::string> messages = {"one", "two", "three"};
  const auto buffer = Open();
  EXPECT_THAT(buffer->Append(&messages), IsOk());
  EXPECT_THAT(Texts(buffer.get(), 1), ElementsAre("two", "three"));
  EXPECT_EQ(buffer->Read(0, 2)->size(), 2);
  EXPECT_THAT(buffer->Remove(2), IsOk());
  EXPECT_THAT(Texts(buffer.get()), ElementsAre("three"));
}

TEST_F(AuditBufferTest, AcceptsMessagesThatFitAndNamesTheSizeOption) {
  std::deque<std::string> messages = {std::string(60, 'a'), std::string(30, 'b'), "0123456789+"};
  auto buffer = Open(100);
  EXPECT_THAT(buffer->Append(&messages),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("--audit-buffer-mib")));
  EXPECT_THAT(messages, ElementsAre("0123456789+"));
  EXPECT_DOUBLE_EQ(buffer->Use(), 0.9);
  buffer.reset();
  buffer = Open(100);
  EXPECT_DOUBLE_EQ(buffer->Use(), 0.9) << "also after a restart";
  EXPECT_THAT(buffer->Remove(1), IsOk());
  EXPECT_DOUBLE_EQ(buffer->Use(), 0.3);
  EXPECT_THAT(buffer->Append(&messages), IsOk());
}

TEST_F(AuditBufferTest, OneProcessHoldsIt) {
  const auto buffer = Open();
  EXPECT_THAT(AuditBuffer::Open(path_, 1000),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr(path_)));
}

TEST_F(AuditBufferTest, IsAccessibleOnlyToItsOwner) {
  const auto buffer = Open();
  std::deque<std::string> messages = {"one"};
  EXPECT_THAT(buffer->Append(&messages), IsOk());
  for (const auto& entry : fs::directory_iterator(fs::path(path_).parent_path())) {
    EXPECT_EQ(entry.status().permissions() & (fs::perms::group_all | fs::perms::others_all),
              fs::perms::none)
        << entry.path();
  }
}

TEST_F(AuditBufferTest, LeavesNoRemovedMessageOnTheDisk) {
  const auto buffer = Open();
  std::deque<std::string> messages = {"PLANTED-4711"};
  EXPECT_THAT(buffer->Append(&messages), IsOk());
  const auto found = [this] {
    for (const auto& entry : fs::directory_iterator(fs::path(path_).parent_path())) {
      std::ifstream stream(entry.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
      if (bytes.find("PLANTED") != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(found()) << "it would be seen";
  EXPECT_THAT(buffer->Remove(1), IsOk());
  EXPECT_FALSE(found());
}

TEST_F(AuditBufferTest, RefusesAFileThatIsNotADatabaseByName) {
  testing::WriteTestFile(path_, std::string(4096, 'x'));
  EXPECT_THAT(AuditBuffer::Open(path_, 1000).status().message(), HasSubstr(path_));
}

}  // namespace
}  // namespace tissueform
