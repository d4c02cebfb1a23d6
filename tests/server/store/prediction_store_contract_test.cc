// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/prediction_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

// What every prediction store must do.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

class PredictionStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  static std::vector<std::string> Ids(const PredictionStore::Page& page) {
    std::vector<std::string> ids;
    ids.reserve(page.records.size());
    for (const PredictionRecord& record : page.records) ids.push_back(record.id);
    return ids;
  }

  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  PredictionStore* const store_ = &stores_->predictions();
};

TEST_P(PredictionStoreContractTest, APredictionIsFoundAsItWas) {
  const PredictionRecord record = SamplePrediction("p");
  const std::string positions = SamplePositions(1);
  ASSERT_THAT(store_->Create(record, positions), IsOk());
  ASSERT_OK_AND_ASSIGN(const PredictionRecord found, store_->Get("p"));
  EXPECT_EQ(found.id, record.id);
  EXPECT_EQ(found.owner, record.owner);
  EXPECT_EQ(found.session, record.session);
  EXPECT_EQ(found.mesh_sha256, record.mesh_sha256);
  EXPECT_EQ(found.created_s, record.created_s);
  EXPECT_EQ(found.metadata, record.metadata);
  EXPECT_EQ(found.vertex_count, record.vertex_count);
  ASSERT_OK_AND_ASSIGN(const std::string read, store_->Positions("p"));
  EXPECT_EQ(read, positions);
}

TEST_P(PredictionStoreContractTest, MissingPredictionIsNotFound) {
  EXPECT_THAT(store_->Get("p"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("p")));
  EXPECT_THAT(store_->Positions("p"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("p")));
  EXPECT_THAT(store_->Delete("p"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("p")));
}

TEST_P(PredictionStoreContractTest, RefusesInvalidOrDuplicatePredictions) {
  EXPECT_THAT(store_->Create(SamplePrediction(""), SamplePositions(1)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("id")));
  EXPECT_THAT(store_->Create(SamplePrediction("p"), SamplePositions(1, 39)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("12 per vertex")));
  EXPECT_THAT(store_->Create(SamplePrediction("p"), SamplePositions(1) + "x"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("12 per vertex")));
  ASSERT_THAT(store_->Create(SamplePrediction("p"), SamplePositions(1)), IsOk());
  EXPECT_THAT(store_->Create(SamplePrediction("p", "other"), SamplePositions(2)),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("p")));
  ASSERT_OK_AND_ASSIGN(const std::string positions, store_->Positions("p"));
  EXPECT_EQ(positions, SamplePositions(1));
}

TEST_P(PredictionStoreContractTest, EqualPositionsLiveAsLongAsOneOfTheirPredictions) {
  ASSERT_THAT(store_->Create(SamplePrediction("a"), SamplePositions(1)), IsOk());
  ASSERT_THAT(store_->Create(SamplePrediction("b"), SamplePositions(1)), IsOk());
  ASSERT_THAT(store_->Delete("a"), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::string positions, store_->Positions("b"));
  EXPECT_EQ(positions, SamplePositions(1));
  EXPECT_THAT(store_->Positions("a"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->Delete("b"), IsOk());
}

TEST_P(PredictionStoreContractTest, ListsByOwnerAndSessionInOrderPageAfterPage) {
  for (const char* id : {"d", "b", "a", "c"}) {
    ASSERT_THAT(store_->Create(SamplePrediction(id, "planner", "s"), SamplePositions(1)), IsOk());
  }
  ASSERT_THAT(store_->Create(SamplePrediction("e", "planner", "t"), SamplePositions(2)), IsOk());
  ASSERT_THAT(store_->Create(SamplePrediction("f", "", "s"), SamplePositions(3)), IsOk());
  PredictionStore::ListRequest request{.owner = "planner", .session = "s", .limit = 3};
  ASSERT_OK_AND_ASSIGN(PredictionStore::Page page, store_->List(request));
  EXPECT_THAT(Ids(page), ElementsAre("a", "b", "c"));
  EXPECT_EQ(page.records[0].metadata, SamplePrediction("a").metadata);
  request.after = page.next;
  ASSERT_OK_AND_ASSIGN(page, store_->List(request));
  EXPECT_THAT(Ids(page), ElementsAre("d"));
  EXPECT_EQ(page.next, "");
  ASSERT_OK_AND_ASSIGN(page, store_->List({.owner = "planner"}));
  EXPECT_THAT(Ids(page), ElementsAre("a", "b", "c", "d", "e"));
  ASSERT_OK_AND_ASSIGN(page, store_->List({.owner = ""}));
  EXPECT_THAT(Ids(page), ElementsAre("f"));
  ASSERT_OK_AND_ASSIGN(page, store_->List({}));
  EXPECT_THAT(Ids(page), ElementsAre("a", "b", "c", "d", "e", "f"));
  ASSERT_OK_AND_ASSIGN(page, store_->List({.session = "nothing"}));
  EXPECT_THAT(page.records, IsEmpty());
  EXPECT_THAT(store_->List({.limit = 0}), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_P(PredictionStoreContractTest, ListsThoseOfACase) {
  for (const char* id : {"a", "b", "c"}) {
    PredictionRecord record = SamplePrediction(id);
    if (*id != 'b') record.case_sha256 = std::string(64, 'f');
    ASSERT_THAT(store_->Create(record, SamplePositions(1)), IsOk());
  }
  ASSERT_OK_AND_ASSIGN(PredictionStore::Page page,
                       store_->List({.case_sha256 = std::string(64, 'f')}));
  EXPECT_THAT(Ids(page), ElementsAre("a", "c"));
  EXPECT_EQ(page.records[0].case_sha256, std::string(64, 'f'));
  ASSERT_OK_AND_ASSIGN(page, store_->List({.case_sha256 = ""}));
  EXPECT_THAT(Ids(page), ElementsAre("b"));
}

INSTANTIATE_TEST_SUITE_P(Stores, PredictionStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
