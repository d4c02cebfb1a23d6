// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/mesh_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

// What every mesh store must do.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

class MeshStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  // Puts a mesh and returns its name.
  std::string Put(int number, int64_t last_used_s = 1000) {
    const MeshPayload payload = SamplePayload(number);
    MeshRecord record = RecordOf(payload);
    record.last_used_s = last_used_s;
    EXPECT_THAT(store_->Put(record, payload.View()), IsOk());
    return record.sha256;
  }
  static std::vector<std::string> Names(const std::vector<MeshRecord>& records) {
    std::vector<std::string> names;
    names.reserve(records.size());
    for (const MeshRecord& record : records) names.push_back(record.sha256);
    return names;
  }

  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  MeshStore* const store_ = &stores_->meshes();
};

TEST_P(MeshStoreContractTest, AMeshIsFoundAndReadAsItWas) {
  const MeshPayload payload = SamplePayload(1);
  MeshRecord record = RecordOf(payload);
  record.created_s = 17;
  record.last_used_s = 18;
  record.skin_vertex_count = 3;
  ASSERT_THAT(store_->Put(record, payload.View()), IsOk());
  ASSERT_OK_AND_ASSIGN(const MeshRecord found, store_->Find(record.sha256));
  EXPECT_EQ(found.sha256, record.sha256);
  EXPECT_EQ(found.shape.cell_arrays, record.shape.cell_arrays);
  EXPECT_EQ(found.shape.num_vertices, record.shape.num_vertices);
  EXPECT_EQ(found.shape.num_tets, record.shape.num_tets);
  EXPECT_EQ(found.total_bytes, record.total_bytes);
  EXPECT_EQ(found.created_s, 17);
  EXPECT_EQ(found.last_used_s, 18);
  EXPECT_EQ(found.skin_vertex_count, 3);
  ASSERT_OK_AND_ASSIGN(const MeshPayload read, store_->Read(record.sha256));
  EXPECT_EQ(read.View().segments, payload.View().segments);
  EXPECT_EQ(read.View().Sha256(), record.sha256);
}

TEST_P(MeshStoreContractTest, MissingMeshIsNotFound) {
  const std::string name(64, 'a');
  EXPECT_THAT(store_->Find(name), StatusIs(absl::StatusCode::kNotFound, HasSubstr(name)));
  EXPECT_EQ(store_->Read(name).status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(store_->Delete(name), StatusIs(absl::StatusCode::kNotFound, HasSubstr(name)));
  EXPECT_THAT(store_->Find("../../etc"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Touch({name}, 5), IsOk());
}

TEST_P(MeshStoreContractTest, TheSameMeshAgainIsKeptOnce) {
  const std::string name = Put(1, 1000);
  EXPECT_EQ(Put(1, 2000), name);
  ASSERT_OK_AND_ASSIGN(MeshRecord record, store_->Find(name));
  EXPECT_EQ(record.last_used_s, 2000);
  Put(1, 500);
  ASSERT_OK_AND_ASSIGN(record, store_->Find(name));
  EXPECT_EQ(record.last_used_s, 2000) << "never goes back";
  ASSERT_OK_AND_ASSIGN(const MeshStore::Page page, store_->List("", 10));
  EXPECT_THAT(Names(page.records), ElementsAre(name));
  EXPECT_THAT(store_->Delete(name), IsOk());
  EXPECT_EQ(store_->Read(name).status().code(), absl::StatusCode::kNotFound);
}

TEST_P(MeshStoreContractTest, ARecordThatIsNotOfThePayloadIsRefused) {
  const MeshPayload payload = SamplePayload(1);
  const auto refused = [&](auto change) {
    MeshRecord record = RecordOf(payload);
    change(record);
    EXPECT_THAT(store_->Put(record, payload.View()), StatusIs(absl::StatusCode::kInvalidArgument));
  };
  refused([](MeshRecord& record) { record.sha256 = "../../somewhere"; });
  refused([](MeshRecord& record) { ++record.total_bytes; });
  refused([](MeshRecord& record) { ++record.shape.num_tets; });
  refused([](MeshRecord& record) { record.shape.cell_arrays = {"other"}; });
  ASSERT_OK_AND_ASSIGN(const MeshStore::Page page, store_->List("", 10));
  EXPECT_THAT(page.records, IsEmpty());
}

TEST_P(MeshStoreContractTest, ListsByNamePageAfterPage) {
  std::vector<std::string> names;
  names.reserve(5);
  for (int number = 0; number < 5; ++number) names.push_back(Put(number));
  std::sort(names.begin(), names.end());
  std::vector<std::string> found;
  std::string after;
  do {
    ASSERT_OK_AND_ASSIGN(const MeshStore::Page page, store_->List(after, 2));
    EXPECT_LE(page.records.size(), 2);
    for (const std::string& name : Names(page.records)) found.push_back(name);
    after = page.next;
  } while (!after.empty());
  EXPECT_EQ(found, names);
  EXPECT_THAT(store_->List("", 0), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_P(MeshStoreContractTest, ListsLongUnusedMeshesOldestFirst) {
  const std::string a = Put(1, 1000);
  const std::string b = Put(2, 900);
  const std::string c = Put(3, 800);
  ASSERT_THAT(store_->Touch({c}, 950), IsOk());
  ASSERT_THAT(store_->Touch({b}, 5), IsOk());
  ASSERT_OK_AND_ASSIGN(std::vector<MeshRecord> unused, store_->ListUnused(1000, 10));
  EXPECT_THAT(Names(unused), ElementsAre(b, c));
  ASSERT_OK_AND_ASSIGN(unused, store_->ListUnused(2000, 1));
  EXPECT_THAT(Names(unused), ElementsAre(b));
  EXPECT_THAT(store_->ListUnused(2000, 0), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_P(MeshStoreContractTest, PutsAndDeletesOfOneMeshAtOnceLeaveItWholeOrGone) {
  const MeshPayload payload = SamplePayload(1);
  const MeshRecord record = RecordOf(payload);
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 15; ++round) {
        if (i % 2 == 0) {
          EXPECT_THAT(store_->Put(record, payload.View()), IsOk());
        } else {
          const absl::Status status = store_->Delete(record.sha256);
          EXPECT_TRUE(status.ok() || absl::IsNotFound(status)) << status;
        }
        const absl::StatusOr<MeshPayload> read = store_->Read(record.sha256);
        EXPECT_TRUE(read.ok() || absl::IsNotFound(read.status())) << read.status();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_THAT(store_->Put(record, payload.View()), IsOk());
  ASSERT_OK_AND_ASSIGN(const MeshPayload read, store_->Read(record.sha256));
  EXPECT_EQ(read.View().segments, payload.View().segments);
}

INSTANTIATE_TEST_SUITE_P(Stores, MeshStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
