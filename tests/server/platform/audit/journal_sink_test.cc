// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/journal_sink.h"

#include <chrono>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/journal_socket.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using testing::JournalSocket;
using testing::StatusIs;

const AuditProgram kProgram = {.name = "tissueform-server", .message_id = "tissueform-call"};

class JournalSinkTest : public ::testing::Test {
 protected:
  std::unique_ptr<JournalSink> Open() const {
    auto sink = JournalSink::Open(kProgram, path_);
    EXPECT_THAT(sink, IsOk());
    return *std::move(sink);
  }

  const std::string path_ = testing::NewSocketPath();
};

TEST_F(JournalSinkTest, AnEntryHasItsFields) {
  JournalSocket journal(path_);
  const auto sink = Open();
  std::deque<std::string> messages = {R"({"event":"call","a":"b=c"})", "two"};
  EXPECT_THAT(sink->Take(&messages), IsOk());
  EXPECT_THAT(messages, IsEmpty());
  const auto entries = journal.Entries();
  ASSERT_EQ(entries.size(), 2);
  EXPECT_EQ(entries[0], (JournalSocket::Fields{{"SYSLOG_IDENTIFIER", "tissueform-server-audit"},
                                               {"PRIORITY", "5"},
                                               {"SYSLOG_FACILITY", "10"},
                                               {"MESSAGE", R"({"event":"call","a":"b=c"})"}}));
  EXPECT_EQ(entries[1].at("MESSAGE"), "two");
}

TEST_F(JournalSinkTest, WithoutAJournalItDoesNotOpen) {
  EXPECT_THAT(JournalSink::Open(kProgram, path_),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("start systemd-journald")));
  { const JournalSocket gone(path_); }
  EXPECT_THAT(JournalSink::Open(kProgram, path_), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(JournalSink::Open(kProgram, std::string(200, 'x')),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(JournalSinkTest, LostJournalIsAnErrorAndARestoredOneIsUsed) {
  std::optional<JournalSocket> journal(path_);
  const auto sink = Open();
  std::deque<std::string> messages = {"one"};
  EXPECT_THAT(sink->Take(&messages), IsOk());
  journal.reset();
  messages = {"two", "three"};
  EXPECT_THAT(sink->Take(&messages), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(sink->Take(&messages), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(messages, ElementsAre("two", "three")) << "nothing is lost";
  journal.emplace(path_);
  EXPECT_THAT(sink->Take(&messages), IsOk());
  EXPECT_THAT(journal->Messages(), ElementsAre("two", "three"));
}

TEST_F(JournalSinkTest, AJournalThatDoesNotReadIsAnErrorAfterASecond) {
  JournalSocket journal(path_);
  const auto sink = Open();
  std::deque<std::string> messages(10'000, "a message");
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(sink->Take(&messages),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("does not read")));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  const size_t waiting = messages.size();
  EXPECT_GT(waiting, 0);
  EXPECT_EQ(journal.Messages().size(), 10'000 - waiting) << "each is taken once";
  EXPECT_THAT(sink->Take(&messages), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(journal.Messages().size(), waiting - messages.size());
}

}  // namespace
}  // namespace tissueform
