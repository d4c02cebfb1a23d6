// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/collector_sink.h"

#include <chrono>
#include <csignal>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/tls_collector.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;
using testing::TestAuthority;
using testing::TestFiles;
using testing::TlsCollector;

const AuditProgram kProgram = {.name = "tissueform-server", .message_id = "tissueform-call"};
constexpr std::chrono::seconds kPatience{60};

class CollectorSinkTest : public ::testing::Test {
 protected:
  void SetUp() override { std::signal(SIGPIPE, SIG_IGN); }

  void StartCollector(TlsCollector::Options options = {}) {
    collector_.reset();
    if (options.identity.certificate.empty()) options.identity = identity_;
    if (options.port == 0) options.port = port_;
    collector_.emplace(options);
    port_ = collector_->port();
  }

  CollectorSink::Options Options() const {
    return {
        .host = "localhost",
        .port = port_,
        .tls = {.certificate = own_.certificate, .key = own_.key, .authorities = identity_.roots},
        .buffer_file = (folder_ / "buffer.db").string(),
        .settle_time = milliseconds(50),
        .backoff = {.first = milliseconds(5), .most = milliseconds(20)}};
  }
  void StartSink() { StartSink(Options()); }
  void StartSink(const CollectorSink::Options& options) {
    sink_.reset();
    auto sink = CollectorSink::Open(kProgram, options);
    ASSERT_THAT(sink, IsOk());
    sink_ = *std::move(sink);
  }

  // Messages "text N " from `first` on.
  absl::Status Send(int first, int count, const std::string& tail = "") {
    std::deque<std::string> messages;
    for (int i = first; i < first + count; ++i) {
      messages.push_back(absl::StrCat("text ", i, " ", tail));
    }
    return sink_->Take(&messages);
  }

  static bool Eventually(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(milliseconds(1));
    }
    return true;
  }
  bool IsEmptied() const { return sink_->BufferUse() == 0; }

  // How often each text from 1 to `count` has come, and whether first arrivals are in order.
  static void ExpectAll(const std::vector<std::string>& messages, int count, bool once) {
    int next = 1;
    for (const std::string& message : messages) {
      if (absl::StrContains(message, absl::StrCat("] text ", next, " "))) {
        EXPECT_THAT(message, HasSubstr(absl::StrCat("[meta sequenceId=\"", next, "\"]")));
        ++next;
      } else {
        EXPECT_FALSE(once) << message;
      }
    }
    EXPECT_EQ(next, count + 1);
  }

  const fs::path folder_ = testing::EmptyTestFolder(
      std::string("collector_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const TestAuthority authority_;
  const TestFiles identity_ = authority_.IssueFiles(folder_, "collector");
  const TestFiles own_ = authority_.IssueFiles(folder_, "own", {.name = "planning-server"});
  int port_ = 0;
  std::optional<TlsCollector> collector_;
  std::unique_ptr<CollectorSink> sink_;
};

TEST_F(CollectorSinkTest, MessagesComeOnceInOrderAndLeaveTheBuffer) {
  StartCollector();
  StartSink();
  for (int i = 1; i <= 2000; i += 100) EXPECT_THAT(Send(i, 100), IsOk());
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  ExpectAll(collector_->messages(), 2000, /*once=*/true);
  EXPECT_EQ(collector_->connections(), 1);
  EXPECT_EQ(collector_->peer_name(), "planning-server");
}

TEST_F(CollectorSinkTest, ACollectorThatIsAwayAtTheStartGetsAllWhenItComes) {
  StartCollector();
  collector_.reset();
  StartSink();
  EXPECT_THAT(Send(1, 300), IsOk()) << "the buffer takes them";
  StartCollector();
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  ExpectAll(collector_->messages(), 300, /*once=*/true);
}

TEST_F(CollectorSinkTest, ACollectorThatBreaksOffGetsEveryMessageAtLeastOnce) {
  StartCollector({.closes_after = 300});
  StartSink();
  for (int i = 1; i <= 1000; i += 100) EXPECT_THAT(Send(i, 100), IsOk());
  ASSERT_TRUE(Eventually([&] { return collector_->connections() >= 2; }));
  std::vector<std::string> messages = collector_->messages();
  StartCollector();
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  const std::vector<std::string> later = collector_->messages();
  messages.insert(messages.end(), later.begin(), later.end());
  for (int i = 1; i <= 1000; ++i) {
    EXPECT_THAT(messages, ::testing::Contains(HasSubstr(
                              absl::StrCat("[meta sequenceId=\"", i, "\"] text ", i, " "))));
  }
}

TEST_F(CollectorSinkTest, ACollectorThatDoesNotReadStopsNoCaller) {
  StartCollector({.reads = false});
  StartSink();
  const std::string tail(1000, 'x');
  const auto start = std::chrono::steady_clock::now();
  for (int i = 1; i <= 20'000; i += 1000) EXPECT_THAT(Send(i, 1000, tail), IsOk());
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  EXPECT_GT(sink_->BufferUse(), 0);
  collector_->Read();
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  ExpectAll(collector_->messages(), 20'000, /*once=*/true);
}

TEST_F(CollectorSinkTest, ACollectorThatNeverReadsIsLeftAndTriedAgain) {
  StartCollector({.reads = false});
  CollectorSink::Options options = Options();
  options.patience = milliseconds(50);
  StartSink(options);
  const std::string tail(1000, 'x');
  for (int i = 1; i <= 20'000; i += 1000) EXPECT_THAT(Send(i, 1000, tail), IsOk());
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_GT(sink_->BufferUse(), 0);
  StartCollector();
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
}

TEST_F(CollectorSinkTest, FullBufferRefusesUntilTheCollectorDrainsIt) {
  StartCollector();
  collector_.reset();
  CollectorSink::Options options = Options();
  options.max_buffer_bytes = 1000;
  StartSink(options);
  std::deque<std::string> messages(50, std::string(100, 'x'));
  EXPECT_THAT(sink_->Take(&messages),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("start the collector")));
  EXPECT_EQ(messages.size(), 40) << "ten are in the buffer";
  EXPECT_EQ(sink_->BufferUse(), 1);
  StartCollector();
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  EXPECT_EQ(collector_->messages().size(), 10);
  messages.resize(5);
  EXPECT_THAT(sink_->Take(&messages), IsOk());
}

TEST_F(CollectorSinkTest, SendsBufferedMessagesAfterARestart) {
  StartCollector();
  collector_.reset();
  StartSink();
  EXPECT_THAT(Send(1, 100), IsOk());
  sink_.reset();
  StartCollector();
  StartSink();
  EXPECT_THAT(Send(101, 100), IsOk());
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  ExpectAll(collector_->messages(), 200, /*once=*/true);
}

TEST_F(CollectorSinkTest, AnOrderlyEndSendsAllAndLeavesNoDuplicates) {
  StartCollector();
  CollectorSink::Options options = Options();
  options.settle_time = std::chrono::hours(1);
  StartSink(options);
  EXPECT_THAT(Send(1, 500), IsOk());
  StartSink();
  EXPECT_TRUE(IsEmptied());
  EXPECT_THAT(Send(501, 1), IsOk());
  EXPECT_TRUE(Eventually([&] { return IsEmptied(); }));
  ExpectAll(collector_->messages(), 501, /*once=*/true);
}

TEST_F(CollectorSinkTest, TheEndDoesNotWaitForACollectorThatDoesNotRead) {
  StartCollector({.reads = false});
  CollectorSink::Options options = Options();
  options.last_time = milliseconds(50);
  StartSink(options);
  const std::string tail(1000, 'x');
  for (int i = 1; i <= 20'000; i += 1000) EXPECT_THAT(Send(i, 1000, tail), IsOk());
  const auto start = std::chrono::steady_clock::now();
  sink_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST_F(CollectorSinkTest, ACertificateOfAnotherAuthorityOrNameGetsNothing) {
  const TestAuthority stranger("Stranger");
  const TestFiles wrong_authority = stranger.IssueFiles(folder_, "stranger");
  const TestFiles wrong_name = authority_.IssueFiles(
      folder_, "elsewhere", {.name = "elsewhere", .alternatives = "DNS:elsewhere.example"});
  for (const TestFiles& identity : {wrong_authority, wrong_name}) {
    StartCollector({.identity = identity});
    StartSink();
    EXPECT_THAT(Send(1, 10), IsOk()) << "the buffer takes them";
    std::this_thread::sleep_for(milliseconds(100));
    EXPECT_TRUE(collector_->messages().empty());
    EXPECT_GT(sink_->BufferUse(), 0);
  }
}

}  // namespace
}  // namespace tissueform
