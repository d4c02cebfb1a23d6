// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "client/pacs_bridge/review/review_server.h"
#include "client/pacs_bridge/review/shown_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

// The review page as curl sees it.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kHostileName[] = "<script>alert(1)</script>^\"'&\x01\xff";

class ReviewTest : public ::testing::Test {
 protected:
  ReviewTest()
      : root_(EmptyTestFolder("review")), queue_(*BridgeQueue::Open((root_ / "state").string())) {
    AddCase("1.2", {.id = "4711", .name = "Planted^Patricia", .birth_date = "19610203"}, "a");
    AddCase("1.3", {.id = "0815", .name = kHostileName, .birth_date = "19700101"}, "b");
    QueuedExport asked;
    asked.name = "exports/1";
    asked.key = NewQueueKey();
    asked.prediction = "predictions/1";
    asked.case_name = "cases/a";
    EXPECT_THAT(ExportRows(queue_.get()).Add(asked), IsOk());
    const fs::path pictures = queue_->object_folder(asked.key) + "/pictures";
    fs::create_directories(pictures);
    std::ofstream(pictures / "front.png") << "a picture";
    picture_ = absl::StrCat("/pictures/", asked.key, "/front.png");
  }

  void AddCase(const std::string& study, const PatientIdentity& patient, const std::string& name) {
    ReceivedRows rows(queue_.get());
    QueuedSeries series;
    series.study_uid = study;
    series.uid = study + ".1";
    series = *rows.Add({.uid = study, .patient = patient, .date = "20260102"}, series,
                       NewQueueKey(), {});
    series.state = SeriesState::kPublished;
    series.case_name = "cases/" + name;
    EXPECT_THAT(rows.Update(series), IsOk());
  }

  void Start(ReviewOptions options = {}) {
    options.port = 0;
    options.planner_url = "https://planner.example.org/";
    auto server = ReviewServer::Start(options, queue_.get(), [this] { ++confirmed_; });
    ASSERT_THAT(server, IsOk());
    server_ = *std::move(server);
  }

  std::string Curl(const std::string& arguments, const std::string& path = "/") {
    const std::string command =
        absl::StrCat("curl -sS -i --max-time 20 ", arguments,
                     " 'http://127.0.0.1:", server_->port(), path, "' 2>&1");
    std::string answer;
    FILE* pipe = popen(command.c_str(), "r");
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
      answer += static_cast<char>(c);
    }
    pclose(pipe);
    return answer;
  }

  // The value of a hidden field of the page's form.
  static std::string FieldOf(const std::string& page, const std::string& name) {
    const std::string begin = absl::StrCat("name=\"", name, "\" value=\"");
    const size_t at = page.find(begin);
    if (at == std::string::npos) return {};
    const size_t value = at + begin.size();
    return page.substr(value, page.find('"', value) - value);
  }
  static std::string FormOf(const std::string& page) {
    return absl::StrCat("-d token=", FieldOf(page, "token"), " -d export=", FieldOf(page, "export"),
                        " -d patient=", FieldOf(page, "patient"));
  }
  BridgeExportState State() { return ExportRows(queue_.get()).Get("exports/1")->state; }

  const fs::path root_;
  const std::unique_ptr<BridgeQueue> queue_;
  std::string picture_;
  std::atomic<int> confirmed_ = 0;
  std::unique_ptr<ReviewServer> server_;
};

TEST_F(ReviewTest, ShowsThePatientAndLinksToThePlanner) {
  Start();
  const std::string page = Curl("");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, HasSubstr("Planted, Patricia"));
  EXPECT_THAT(page, HasSubstr("1961-02-03"));
  EXPECT_THAT(page, HasSubstr("href=\"https://planner.example.org/#case=a\""));
  EXPECT_THAT(page, HasSubstr(picture_));
  EXPECT_THAT(Curl("", picture_), HasSubstr("a picture"));
}

TEST_F(ReviewTest, NothingInANameIsMarkup) {
  Start();
  const std::string page = Curl("");
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert(1)&lt;/script&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("\x01")));
  EXPECT_EQ(EscapedHtml("\xff\xC3\xA9<"), "\xEF\xBF\xBD\xC3\xA9&lt;");
}

TEST_F(ReviewTest, NothingIsCachedOrLoadedFromElsewhere) {
  Start();
  const std::string page = Curl("");
  EXPECT_THAT(page, HasSubstr("Cache-Control: no-store"));
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy: default-src 'none'"));
  EXPECT_THAT(page, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(page, HasSubstr("X-Content-Type-Options: nosniff"));
}

TEST_F(ReviewTest, AFormOfThePageConfirms) {
  Start();
  const std::string page = Curl("");
  EXPECT_THAT(Curl(FormOf(page), "/store"), StartsWith("HTTP/1.1 303"));
  EXPECT_EQ(State(), BridgeExportState::kConfirmed);
  EXPECT_EQ(confirmed_, 1);
  EXPECT_THAT(Curl(FormOf(page), "/store"), StartsWith("HTTP/1.1 409")) << "once";
}

TEST_F(ReviewTest, AFormFromElsewhereIsRefused) {
  Start();
  const std::string page = Curl("");
  EXPECT_THAT(Curl(absl::StrCat(FormOf(page), " -H 'Origin: https://evil.example.org'"), "/store"),
              StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Curl("-d token=guessed -d export=exports/1", "/store"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Curl("", "/store"), StartsWith("HTTP/1.1 404")) << "a link stores nothing";
  EXPECT_EQ(State(), BridgeExportState::kAsked);
}

TEST_F(ReviewTest, DoesNotConfirmAPatientChangedSinceThePageWasShown) {
  Start();
  const std::string page = Curl("");
  ExportRows rows(queue_.get());
  ASSERT_OK_AND_ASSIGN(const QueuedExport asked, rows.Get("exports/1"));
  ASSERT_THAT(rows.UpdateWithPatient(asked, "1.2", {.id = "MERGED", .name = "M"}), IsOk());
  EXPECT_THAT(Curl(FormOf(page), "/store"), StartsWith("HTTP/1.1 409"));
  EXPECT_EQ(State(), BridgeExportState::kAsked);
}

TEST_F(ReviewTest, AnotherHostIsRefused) {
  Start({.allowed_hosts = {"review.example.org"}});
  EXPECT_THAT(Curl("-H 'Host: evil.example.org'"), StartsWith("HTTP/1.1 421"));
  EXPECT_THAT(Curl("-H 'Host: evil.example.org'"), Not(HasSubstr("Planted")));
  EXPECT_THAT(Curl("-H 'Host: review.example.org'"), StartsWith("HTTP/1.1 200"));
}

TEST_F(ReviewTest, ItsPasswordIsAskedForEverything) {
  const std::string file = (root_ / "password").string();
  std::ofstream(file) << "correct horse battery staple\n";
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  Start({.token_file = file});
  for (const std::string& path : {std::string("/"), picture_, std::string("/style.css")}) {
    EXPECT_THAT(Curl("", path), StartsWith("HTTP/1.1 401")) << path;
    EXPECT_THAT(Curl("-u 'x:wrong horse battery staple'", path), StartsWith("HTTP/1.1 401"));
    EXPECT_THAT(Curl("-u 'x:correct horse battery staple'", path), StartsWith("HTTP/1.1 200"));
  }
}

TEST_F(ReviewTest, EveryRequestWithAPasswordIsReportedAndServedWhenThatIsTaken) {
  const std::string file = (root_ / "password").string();
  std::ofstream(file) << "correct horse battery staple\n";
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  std::mutex mutex;
  std::vector<std::string> logins;
  Start({.token_file = file, .on_login = [&](const ReviewLogin& login) {
           const std::lock_guard<std::mutex> lock(mutex);
           logins.push_back(absl::StrCat(login.address, " ", login.user, " ", login.is_accepted));
           return absl::OkStatus();
         }});
  Curl("");
  Curl("-H 'Authorization: Bearer x'");
  Curl("-u 'eve:wrong horse battery staple'");
  EXPECT_THAT(Curl("-u 'ada:correct horse battery staple'"), StartsWith("HTTP/1.1 200"));
  const std::lock_guard<std::mutex> lock(mutex);
  EXPECT_THAT(logins, ElementsAre("127.0.0.1  0", "127.0.0.1 eve 0", "127.0.0.1 ada 1"));
}

TEST_F(ReviewTest, ALoginThatCannotBeRecordedIsNotServed) {
  const std::string file = (root_ / "password").string();
  std::ofstream(file) << "correct horse battery staple\n";
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  Start({.token_file = file,
         .on_login = [](const ReviewLogin&) { return absl::UnavailableError("full"); }});
  const std::string page = Curl("-u 'ada:correct horse battery staple'");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 503"));
  EXPECT_THAT(page, Not(HasSubstr("Planted")));
  EXPECT_THAT(Curl("-u 'ada:wrong horse battery staple'"), StartsWith("HTTP/1.1 401"));
}

TEST_F(ReviewTest, WithoutAPasswordItListensOnLoopbackOnly) {
  EXPECT_THAT(
      ReviewServer::Start({.address = "0.0.0.0", .port = 0}, queue_.get(), nullptr).status(),
      StatusIs(absl::StatusCode::kInvalidArgument));
  const std::string file = (root_ / "password").string();
  std::ofstream(file) << "short";
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_THAT(ReviewServer::Start({.port = 0, .token_file = file}, queue_.get(), nullptr).status(),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(ReviewTest, RefusesPathsOutsideThePictures) {
  Start();
  for (const char* path : {"/pictures/../../queue.db", "/pictures/a/front.png", "/queue.db"}) {
    EXPECT_THAT(Curl("--path-as-is", path), StartsWith("HTTP/1.1 404")) << path;
  }
}

TEST_F(ReviewTest, ALongBodyIsRefused) {
  Start();
  EXPECT_THAT(Curl(absl::StrCat("-d token=", std::string(40'000, 'x')), "/store"),
              StartsWith("HTTP/1.1 413"));
}

TEST_F(ReviewTest, ASecondServerDoesNotShareThePort) {
  Start();
  EXPECT_THAT(ReviewServer::Start({.port = server_->port()}, queue_.get(), nullptr).status(),
              StatusIs(absl::StatusCode::kUnavailable));
}

TEST(ShownTextTest, IsForPeople) {
  EXPECT_EQ(ShownName("Planted^Patricia^Q"), "Planted, Patricia Q");
  EXPECT_EQ(ShownName("Yamada^Tarou=X^Y=Z^W"), "Yamada, Tarou (X, Y; Z, W)");
  EXPECT_EQ(ShownName(""), "");
  EXPECT_EQ(ShownDate("19610203"), "1961-02-03");
  EXPECT_EQ(ShownDate("1961"), "1961");
}

}  // namespace
}  // namespace tissueform::testing
