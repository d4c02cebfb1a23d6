// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/housekeeping.h"

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "server/store/sql_stores.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Bar;
using testing::BarRecord;
using testing::FakeClock;
using testing::IsOk;
using testing::SampleMesh;
using testing::StatusIs;

constexpr int64_t kDay = 24 * 3600;
constexpr int64_t kStart = 1'700'000'000;

using Opened = absl::StatusOr<std::shared_ptr<Session>>;

// A server's inside without its network, with both clocks in the test's hand.
class HousekeepingTest : public ::testing::Test {
 protected:
  HousekeepingTest() {
    stores_ = *OpenInMemoryStores([this] { return unix_s_.load(); });
    Restart();
    bar_ = testing::Store(SampleMesh(Bar({2, 2, 3})), catalog_.get());
  }
  ~HousekeepingTest() override { Stop(); }

  void Stop() {
    housekeeping_.reset();
    if (registry_ != nullptr) registry_->Stop();
    pool_.reset();
    registry_.reset();
  }

  // The same stores, nothing in memory.
  void Restart(int retention_days = 30) {
    Stop();
    bar_.reset();
    catalog_ = std::make_unique<MeshCatalog>(limits_, &budget_, &stores_->meshes(), &clock_,
                                             [this] { return unix_s_.load(); });
    pool_ = std::make_unique<WorkerPool>(1);
    registry_ = std::make_unique<SessionRegistry>(limits_, &budget_, pool_.get(),
                                                  &stores_->sessions(), catalog_.get(), &clock_);
    ASSERT_THAT(registry_->sync().LearnAll(), IsOk());
    housekeeping_ = std::make_unique<Housekeeping>(
        Housekeeping::Options{.retention_days = retention_days,
                              .unix_clock = [this] { return unix_s_.load(); },
                              .clock = &clock_},
        stores_.get(), registry_.get(), catalog_.get());
  }

  // Both clocks go on.
  void Pass(int64_t seconds) {
    clock_.Advance(std::chrono::seconds(seconds));
    unix_s_ += seconds;
  }

  std::shared_ptr<Session> Create(const std::string& id) {
    SessionRecord record = BarRecord(*bar_);
    record.id = id;
    std::promise<Opened> made;
    registry_->loader().Create(std::move(record), bar_, std::make_shared<std::atomic<bool>>(),
                               [&made](Opened session) { made.set_value(std::move(session)); });
    Opened session = made.get_future().get();
    EXPECT_THAT(session, IsOk());
    WaitForWorker();
    return session.value_or(nullptr);
  }

  std::shared_ptr<Session> Open(const std::string& id) {
    std::promise<Opened> opened;
    registry_->loader().Open(id, std::make_shared<std::atomic<bool>>(),
                             [&opened](Opened session) { opened.set_value(std::move(session)); });
    Opened session = opened.get_future().get();
    EXPECT_THAT(session, IsOk());
    WaitForWorker();
    return session.value_or(nullptr);
  }

  // The job that has answered holds what it worked on until it ends.
  void WaitForWorker() {
    for (const Lane lane : {Lane::kStore, Lane::kBatch, Lane::kSolves}) {
      std::promise<void> reached;
      pool_->Post(lane, [&reached] { reached.set_value(); });
      reached.get_future().wait();
    }
  }

  absl::StatusOr<SessionRecord> Record(const std::string& id) {
    absl::StatusOr<SessionRecord> result;
    stores_->sessions().Get(
        id, [&result](absl::StatusOr<SessionRecord> record) { result = std::move(record); });
    return result;
  }

  void EvictAll() {
    registry_->table().Evict([] { return false; });
    catalog_->RemoveIdle(SessionTable::kInUse);
  }

  // Of a case of one byte; returns its name.
  std::string KeepCase(char byte) {
    const std::string bytes(1, byte);
    absl::StatusOr<std::unique_ptr<CaseWriter>> writer = stores_->cases().Begin(
        {.sha256 = Sha256Hex({bytes}), .total_bytes = 1, .last_used_s = unix_s_}, 100);
    EXPECT_THAT(writer, IsOk());
    EXPECT_THAT((*writer)->Write(0, bytes), IsOk());
    EXPECT_THAT((*writer)->Finish(), IsOk());
    return Sha256Hex({bytes});
  }

  void Predict(const std::string& id, const std::string& session, const std::string& mesh,
               const std::string& of_case = "") {
    PredictionRecord record;
    record.case_sha256 = of_case;
    record.id = id;
    record.session = session;
    record.mesh_sha256 = mesh;
    record.created_s = unix_s_;
    record.vertex_count = 1;
    ASSERT_THAT(stores_->predictions().Create(record, std::string(12, 'p')), IsOk());
  }

  FakeClock clock_;
  std::atomic<int64_t> unix_s_ = kStart;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  std::unique_ptr<Stores> stores_;
  std::unique_ptr<MeshCatalog> catalog_;
  std::unique_ptr<WorkerPool> pool_;
  std::unique_ptr<SessionRegistry> registry_;
  std::unique_ptr<Housekeeping> housekeeping_;
  std::shared_ptr<const StoredMesh> bar_;
};

TEST_F(HousekeepingTest, RemovesUnusedSessionsExactlyAfterTheirRetention) {
  const std::string mesh = bar_->sha256;
  Create("a");
  bar_.reset();
  housekeeping_->RunOnce();
  Pass(30 * kDay);
  EvictAll();
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 0);
  EXPECT_THAT(Record("a"), IsOk());
  Pass(1);
  const Housekeeping::Removed removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.sessions, 1);
  EXPECT_THAT(Record("a"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_FALSE(registry_->table().Knows("a"));
  EXPECT_EQ(removed.meshes, 1) << "no session is made from it any longer";
  EXPECT_THAT(stores_->meshes().Find(mesh), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

// As a database that several servers share: with a time of its own.
class SharedStores final : public Stores {
 public:
  SharedStores(Stores* stores, const std::atomic<int64_t>* now_s)
      : stores_(*stores), now_s_(*now_s) {}

  SessionStore& sessions() override { return stores_.sessions(); }
  MeshStore& meshes() override { return stores_.meshes(); }
  UploadStore& uploads() override { return stores_.uploads(); }
  PredictionStore& predictions() override { return stores_.predictions(); }
  CaseStore& cases() override { return stores_.cases(); }
  SqlDatabase& database() override { return stores_.database(); }
  bool keeps() const override { return true; }
  int64_t NowS() const override { return now_s_; }
  absl::Status AskTime() override { return answer; }

  absl::Status answer;

 private:
  Stores& stores_;
  const std::atomic<int64_t>& now_s_;
};

TEST_F(HousekeepingTest, UsesTheClockOfASharedStore) {
  Create("a");
  bar_.reset();
  SharedStores shared(stores_.get(), &unix_s_);
  // The machine that this runs on is years ahead of it.
  Housekeeping housekeeping({.clock = &clock_}, &shared, registry_.get(), catalog_.get());
  housekeeping.RunOnce();
  Pass(30 * kDay);
  EvictAll();
  EXPECT_EQ(housekeeping.RunOnce().sessions, 0);
  Pass(1);
  shared.answer = absl::UnavailableError("away");
  EXPECT_EQ(housekeeping.RunOnce().sessions, 0) << "nobody knows what is old";
  shared.answer = absl::OkStatus();
  EXPECT_EQ(housekeeping.RunOnce().sessions, 1);
}

TEST_F(HousekeepingTest, RecordsUsesButNotARestart) {
  Create("used");
  Create("idle");
  bar_.reset();
  housekeeping_->RunOnce();
  Pass(20 * kDay);
  EvictAll();
  Open("used");
  housekeeping_->WriteUse();
  EXPECT_EQ(Record("used")->last_used_s, kStart + 20 * kDay);
  EXPECT_EQ(Record("idle")->last_used_s, kStart);
  Restart();
  housekeeping_->RunOnce();
  Pass(11 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 1);
  EXPECT_THAT(Record("idle"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(Record("used"), IsOk());
}

TEST_F(HousekeepingTest, KeepsASessionHeldByAnIdleStream) {
  const std::shared_ptr<Session> held = Create("held");
  const std::string mesh = bar_->sha256;
  bar_.reset();
  housekeeping_->RunOnce();
  Pass(40 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 0);
  // It has left memory: the stream would go on with another one.
  EvictAll();
  ASSERT_TRUE(held->evicted());
  Pass(40 * kDay);
  const Housekeeping::Removed removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.sessions + removed.meshes, 0);
  EXPECT_THAT(Open("held"), ::testing::NotNull());
}

TEST_F(HousekeepingTest, RetentionOfZeroKeepsEverything) {
  Create("a");
  Predict("p", "gone", bar_->sha256);
  Restart(/*retention_days=*/0);
  Pass(10'000 * kDay);
  const Housekeeping::Removed removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.sessions + removed.predictions + removed.meshes, 0);
  EXPECT_THAT(Record("a"), IsOk());
}

TEST_F(HousekeepingTest, AClockThatIsSetBackDeletesNothingEarly) {
  bar_.reset();
  Restart();
  Pass(1);
  unix_s_ -= 400 * kDay;
  bar_ = testing::Store(SampleMesh(Bar({2, 2, 3})), catalog_.get());
  Create("made meanwhile");
  bar_.reset();
  Pass(60);
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 0);
  EvictAll();
  // Put right: now all that was written before looks as if it had not been used for a year.
  unix_s_ += 400 * kDay;
  Pass(60);
  Housekeeping::Removed removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.sessions + removed.meshes, 0);
  Restart();
  Pass(29 * kDay);
  removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.sessions + removed.meshes, 0) << "the right time was written";
  Pass(2 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 1);
}

TEST_F(HousekeepingTest, AClockThatIsSetForwardDeletesNothingEarly) {
  Create("a");
  bar_.reset();
  housekeeping_->RunOnce();
  Restart();
  unix_s_ += 4'000 * kDay;
  EXPECT_EQ(housekeeping_->RunOnce().sessions, 0);
  EXPECT_THAT(Record("a"), IsOk());
}

TEST_F(HousekeepingTest, PredictionsGoWithTheirAgeOnceTheirSessionIsGoneAndKeepTheirMesh) {
  const std::string mesh = bar_->sha256;
  const std::shared_ptr<Session> held = Create("held");
  bar_.reset();
  Predict("of held", "held", mesh);
  Predict("of gone", "gone", mesh);
  Pass(31 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().predictions, 1);
  EXPECT_THAT(stores_->predictions().Get("of gone"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(stores_->predictions().Get("of held"), IsOk());
  EXPECT_THAT(stores_->meshes().Find(mesh), IsOk());
}

TEST_F(HousekeepingTest, RemovesUnopenedCasesUnlessAPredictionNamesThem) {
  const std::string unused = KeepCase('a');
  const std::string opened = KeepCase('b');
  const std::string predicted = KeepCase('c');
  Pass(20 * kDay);
  ASSERT_THAT(stores_->cases().Open({opened}, unix_s_).status(), IsOk());
  Predict("p", "gone", bar_->sha256, predicted);
  Pass(10 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().cases, 0) << "not a second early";
  Pass(1);
  EXPECT_EQ(housekeeping_->RunOnce().cases, 1);
  EXPECT_THAT(stores_->cases().Find({unused}), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(stores_->cases().Find({opened}), IsOk());
  EXPECT_THAT(stores_->cases().Find({predicted}), IsOk());
  Pass(21 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().cases, 2) << "the prediction has gone with its age";
}

TEST_F(HousekeepingTest, AMeshOfNoSessionStaysWhileAPredictionNamesIt) {
  const std::string mesh = bar_->sha256;
  bar_.reset();
  EvictAll();
  Pass(20 * kDay);
  Predict("p", "gone", mesh);
  Pass(20 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().meshes, 0);
  Pass(11 * kDay);
  EvictAll();
  const Housekeeping::Removed removed = housekeeping_->RunOnce();
  EXPECT_EQ(removed.predictions, 1);
  EXPECT_EQ(removed.meshes, 1);
}

TEST_F(HousekeepingTest, AMeshInMemoryOrJustAskedForStays) {
  const std::string mesh = bar_->sha256;
  const auto start = clock_.Now();
  EXPECT_EQ(catalog_->RemoveUnused(mesh, start).value(), false) << "somebody holds it";
  bar_.reset();
  Pass(1);
  ASSERT_NE(catalog_->Find(mesh), nullptr);
  EXPECT_EQ(catalog_->RemoveUnused(mesh, start).value(), false) << "it was asked for since";
  EXPECT_EQ(catalog_->RemoveUnused(mesh, clock_.Now()).value(), true);
  EXPECT_THAT(catalog_->Load(mesh), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(HousekeepingTest, AMeshWithoutATimeOfUseCountsFromNowOn) {
  const std::string mesh = bar_->sha256;
  // As servers wrote it that knew no such time.
  MeshRecord record = RecordOf(*bar_);
  const MeshPayloadView payload =
      ViewMeshPayload(bar_->mesh.positions(), bar_->mesh.tets(), bar_->cell_arrays);
  ASSERT_THAT(stores_->meshes().Delete(mesh), IsOk());
  ASSERT_THAT(stores_->meshes().Put(record, payload), IsOk());
  Restart();
  EXPECT_EQ(housekeeping_->RunOnce().meshes, 0);
  Pass(30 * kDay);
  EXPECT_EQ(housekeeping_->RunOnce().meshes, 0);
  Pass(1);
  EXPECT_EQ(housekeeping_->RunOnce().meshes, 1);
}

// On the machine's own clock: the age of an upload is its file's.
TEST_F(HousekeepingTest, RemovesInterruptedUploadsAfterADay) {
  unix_s_ = SystemUnixSeconds();
  Restart();
  const SampleMesh sample(Bar({2, 2, 3}));
  const UploadAnnouncement announced = sample.Announcement();
  ASSERT_THAT(stores_->uploads().Begin(announced), IsOk());
  Pass(kDay - 60);
  EXPECT_EQ(housekeeping_->RunOnce().uploads, 0);
  Pass(120);
  EXPECT_EQ(housekeeping_->RunOnce().uploads, 1);
  EXPECT_THAT(stores_->uploads().Committed(announced.sha256),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(HousekeepingTest, StopWritesTheTimesOfUse) {
  housekeeping_->Start();
  Pass(100);
  Create("a");
  const int64_t made_s = unix_s_;
  Pass(100);
  Open("a");
  housekeeping_->Stop();
  EXPECT_EQ(Record("a")->last_used_s, made_s + 100);
}

}  // namespace
}  // namespace tissueform
