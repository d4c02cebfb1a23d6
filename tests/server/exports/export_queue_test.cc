// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/exports/export_queue.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "server/store/sql_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Code = absl::StatusCode;

const std::string kCase(64, 'c');

// A store whose calls fail while it is `broken`.
class BrokenStore final : public ExportStore {
 public:
  explicit BrokenStore(ExportStore* store) : store_(*store) {}
  absl::StatusOr<std::vector<ExportRecord>> Load() override { return store_.Load(); }
  absl::Status Put(const ExportRecord& record) override {
    return broken ? absl::ResourceExhaustedError("full") : store_.Put(record);
  }
  absl::Status Erase(const std::vector<std::string>& ids) override {
    return broken ? absl::ResourceExhaustedError("full") : store_.Erase(ids);
  }

  bool broken = false;

 private:
  ExportStore& store_;
};

class ExportQueueTest : public ::testing::Test {
 protected:
  void Open(std::vector<std::string> gone = {}) {
    changes_ = 0;
    book_ = std::make_unique<ExportQueue>(limits_, &store_, [this] { return now_s_; });
    book_->set_on_changed([this](const ExportRecord& /*record*/) { ++changes_; });
    ASSERT_THAT(book_->LoadAll([&](const std::string& prediction) {
      return std::find(gone.begin(), gone.end(), prediction) == gone.end();
    }),
                IsOk());
  }
  void SetUp() override { Open(); }

  absl::StatusOr<ExportRecord> Ask(const std::string& prediction, const std::string& owner = "ann",
                                   const std::string& key = "") {
    return book_->Create({.prediction = prediction,
                          .case_sha256 = kCase,
                          .owner = owner,
                          .request_key = key,
                          .request_fingerprint = key.empty() ? "" : prediction});
  }
  std::vector<std::string> Predictions(const ExportQueue::ListRequest& request) const {
    std::vector<std::string> names;
    for (const ExportRecord& record : book_->List(request).records) {
      names.push_back(record.prediction);
    }
    return names;
  }

  int64_t now_s_ = 1'800'000'000;
  ExportLimits limits_ = {};
  std::unique_ptr<Stores> stores_ = *OpenInMemoryStores();
  std::unique_ptr<ExportStore> kept_ = std::make_unique<SqlExportStore>(&stores_->database());
  BrokenStore store_{kept_.get()};
  int changes_ = 0;
  std::unique_ptr<ExportQueue> book_;
};

TEST_F(ExportQueueTest, ReopenedQueueKnowsTheSameExports) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord made, Ask("p", "ann", "key"));
  ASSERT_OK_AND_ASSIGN(const ExportRecord changed,
                       book_->Update(made.id, {.state = ExportState::kStored}));
  Open();
  ASSERT_OK_AND_ASSIGN(const ExportRecord found, book_->Find(made.id));
  EXPECT_EQ(found, changed);
  EXPECT_TRUE(book_->IsExported("p"));
  EXPECT_THAT(book_->ExportedOfCase(kCase), ElementsAre("p"));
  ASSERT_OK_AND_ASSIGN(const ExportRecord again, Ask("p", "ann", "key"));
  EXPECT_EQ(again.id, made.id);
}

TEST_F(ExportQueueTest, OpeningRemovesExportsWhosePredictionsAreGone) {
  ASSERT_THAT(Ask("p"), IsOk());
  ASSERT_THAT(Ask("q"), IsOk());
  Open(/*gone=*/{"p"});
  EXPECT_THAT(Predictions({}), ElementsAre("q"));
  EXPECT_FALSE(book_->IsExported("p"));
  Open();
  EXPECT_THAT(Predictions({}), ElementsAre("q")) << "of the store, too";
}

TEST_F(ExportQueueTest, ShowsNothingThatWasNotStored) {
  store_.broken = true;
  EXPECT_THAT(Ask("p"), StatusIs(Code::kResourceExhausted));
  EXPECT_THAT(Predictions({}), IsEmpty());
  EXPECT_FALSE(book_->IsExported("p"));
  store_.broken = false;
  ASSERT_OK_AND_ASSIGN(const ExportRecord made, Ask("p"));
  store_.broken = true;
  EXPECT_THAT(book_->Update(made.id, {.state = ExportState::kStored}),
              StatusIs(Code::kResourceExhausted));
  ASSERT_OK_AND_ASSIGN(const ExportRecord found, book_->Find(made.id));
  EXPECT_EQ(found, made);
  EXPECT_EQ(changes_, 1);
}

TEST_F(ExportQueueTest, ReloadRowsReportsTheChangesOfAnotherServer) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord made, Ask("p"));
  ASSERT_OK_AND_ASSIGN(const ExportRecord stays, Ask("r"));
  ExportRecord changed = made;
  changed.state = ExportState::kStoring;
  changed.version = 2;
  ASSERT_THAT(kept_->Put(changed), IsOk());
  ASSERT_THAT(kept_->Put({.id = "other", .prediction = "q", .owner = "bob"}), IsOk());
  const int before = changes_;
  ASSERT_THAT(book_->ReloadRows(), IsOk());
  EXPECT_EQ(changes_, before + 2) << "what has not changed is not told";
  EXPECT_TRUE(book_->IsExported("q"));
  ASSERT_OK_AND_ASSIGN(const ExportRecord found, book_->Find(made.id));
  EXPECT_EQ(found, changed);
  ASSERT_THAT(kept_->Erase({made.id}), IsOk());
  ASSERT_THAT(book_->ReloadRows(), IsOk());
  EXPECT_THAT(book_->Find(made.id), StatusIs(Code::kNotFound));
  EXPECT_FALSE(book_->IsExported("p"));
  EXPECT_TRUE(book_->IsExported("r"));
  EXPECT_THAT(book_->ExportedOfCase(kCase), ElementsAre("r"));
}

TEST_F(ExportQueueTest, ReadsAnUnknownExportFromTheStoreOnce) {
  int asked = 0;
  book_->set_read_gate([&](const std::string& /*id*/, const std::function<absl::Status()>& read) {
    ++asked;
    return read();
  });
  ASSERT_THAT(kept_->Put({.id = "other", .prediction = "q", .owner = "bob"}), IsOk());
  EXPECT_THAT(book_->Find("other"), StatusIs(Code::kNotFound)) << "not known here yet";
  EXPECT_THAT(book_->FindOrRead("other"), IsOk());
  EXPECT_THAT(book_->FindOrRead("other"), IsOk());
  EXPECT_EQ(asked, 1);
  EXPECT_THAT(book_->FindOrRead("nowhere"), StatusIs(Code::kNotFound));
  EXPECT_EQ(asked, 2);
  ASSERT_OK_AND_ASSIGN(const ExportRecord same, Ask("q", "bob"));
  EXPECT_EQ(same.id, "other") << "one that is not done is given again, whoever has made it";
}

// A watch looks up an export that was withdrawn while it is notified of another. If the look-up
// asked the store it would wait for itself.
TEST_F(ExportQueueTest, TheChangeCallbackFindsAWithdrawalWithoutTheStore) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord gone, Ask("p"));
  book_->set_read_gate(
      [](const std::string& /*id*/, const std::function<absl::Status()>& read) { return read(); });
  absl::Status found;
  book_->set_on_changed(
      [&](const ExportRecord& /*record*/) { found = book_->Find(gone.id).status(); });
  ASSERT_THAT(book_->Remove(gone.id), IsOk());
  ASSERT_THAT(Ask("q"), IsOk());
  EXPECT_THAT(found, StatusIs(Code::kNotFound));
}

TEST_F(ExportQueueTest, WithdrawnExportGrantsNoAccessEvenIfTheDiskFails) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord made, Ask("p"));
  store_.broken = true;
  EXPECT_THAT(book_->Remove(made.id), StatusIs(Code::kResourceExhausted));
  EXPECT_THAT(book_->Find(made.id), StatusIs(Code::kNotFound));
  EXPECT_FALSE(book_->IsExported("p"));
  EXPECT_THAT(book_->ExportedOfCase(kCase), IsEmpty());
}

TEST_F(ExportQueueTest, APredictionIsExportedAsLongAsOneIsLeft) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord first, Ask("p"));
  ASSERT_THAT(book_->Update(first.id, {.state = ExportState::kFailed}), IsOk());
  ASSERT_OK_AND_ASSIGN(const ExportRecord second, Ask("p"));
  ASSERT_THAT(book_->Remove(first.id), IsOk());
  EXPECT_TRUE(book_->IsExported("p"));
  EXPECT_THAT(book_->ExportedOfCase(kCase), ElementsAre("p"));
  ASSERT_THAT(book_->Remove(second.id), IsOk());
  EXPECT_FALSE(book_->IsExported("p"));
  EXPECT_THAT(book_->ExportedOfCase(kCase), IsEmpty());
}

TEST_F(ExportQueueTest, IdsRiseThoughTheClockGoesBack) {
  std::vector<std::string> wanted;
  for (int i = 0; i < 20; ++i) {
    const std::string prediction(1, static_cast<char>('a' + i));
    ASSERT_THAT(Ask(prediction), IsOk());
    wanted.push_back(prediction);
    if (i == 10) now_s_ -= 3600;
    if (i == 15) Open();
  }
  EXPECT_EQ(Predictions({}), wanted);
  const ExportQueue::Page page = book_->List({.limit = 3});
  EXPECT_EQ(Predictions({.after = page.next, .limit = 2}), std::vector<std::string>({"d", "e"}));
}

TEST_F(ExportQueueTest, WaitingExportsOfOneOwnerLeaveRoomForOthers) {
  limits_ = {.max_waiting = 3, .max_waiting_of_principal = 2};
  Open();
  ASSERT_THAT(Ask("p"), IsOk());
  ASSERT_THAT(Ask("q"), IsOk());
  const auto third = Ask("r");
  EXPECT_TRUE(HasReason(third.status(), ErrorReason::kTooManyExports)) << third.status();
  EXPECT_THAT(Ask("s", "bob"), IsOk());
  EXPECT_THAT(Ask("t", "cid"), StatusIs(Code::kResourceExhausted));
  EXPECT_EQ(book_->CountWaiting(), 3);
  EXPECT_EQ(book_->Waiting("ann").size(), 2U);
}

TEST_F(ExportQueueTest, RemovesTheOldestUnchangedExportsFirst) {
  ASSERT_OK_AND_ASSIGN(const ExportRecord changed, Ask("p"));
  ASSERT_THAT(Ask("q"), IsOk());
  ASSERT_THAT(Ask("r"), IsOk());
  now_s_ += 100;
  ASSERT_THAT(book_->Update(changed.id, {.state = ExportState::kStored}), IsOk());
  ASSERT_OK_AND_ASSIGN(const int none, book_->RemoveUnchanged(now_s_ - 100, 9));
  EXPECT_EQ(none, 0);
  ASSERT_OK_AND_ASSIGN(const int some, book_->RemoveUnchanged(now_s_, 1));
  EXPECT_EQ(some, 1);
  EXPECT_THAT(Predictions({}), ElementsAre("p", "r"));
}

}  // namespace
}  // namespace tissueform::testing
