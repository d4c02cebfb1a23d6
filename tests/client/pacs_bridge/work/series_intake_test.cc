// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/series_intake.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/imaging/series/image_header.h"
#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class SeriesIntakeTest : public BridgeWork {};

TEST_F(SeriesIntakeTest, SeriesIsCompleteWhenNoMoreImagesArrive) {
  const CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, SeriesIsCompleteAtOnceIfThePacsCountMatches) {
  count_ = 8;
  const CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving) << "its association is open";
  intake_->Ended({series.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, ASeriesThatStopsMidwayIsNotBuiltUntilTheRestCompletesIt) {
  count_ = 8;
  const CtSeries series = Receive("a", {}, {6, 7});
  intake_->Ended({series.series_uid}, false);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
  for (const size_t i : {6, 7}) {
    fs::rename(root_ / ("a" + std::to_string(i)), series.files[i]);
    intake_->Arrived(series.files[i], *ReadInstanceHeader(series.files[i]));
  }
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, DetectsAMissingSliceWithoutAPacsCount) {
  const CtSeries series = Receive("a", {}, {4});
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(SeriesIntakeTest, CapturesInASeriesHideNoneOfItsSlicesAndGiveNoHeader) {
  CtSeriesOptions options;
  options.study_uid = "1.2.840.1";
  options.series_uid = "1.2.840.3";
  CtSeriesOptions captures = options;
  captures.modality = "OT";
  captures.class_uid = std::string(kColourCaptureClass);
  captures.slices = 20;
  Receive("captures", captures);
  Settle();
  const CtSeries series = Receive("a", options);
  WaitQuietly();
  Settle();
  ASSERT_EQ(StateOf(series), SeriesState::kChosen);
  const QueuedSeries chosen = *rows_.GetByUid(series.series_uid);
  EXPECT_EQ(chosen.modality, "CT");
  EXPECT_THAT(chosen.reason, AllOf(HasSubstr("8 axial slices"), HasSubstr("ignored: 20 other")));
  EXPECT_EQ(ReadInstanceHeader(queue_->header_path(chosen.key))->class_uid, kCtImageClass);
  EXPECT_EQ(SourcesAmong(*rows_.ListImages(chosen.key)).size(), 8);
}

TEST_F(SeriesIntakeTest, AbortedAssociationLeavesTheSeriesIncomplete) {
  const CtSeries series = Receive("a", {}, {6, 7});
  intake_->Ended({series.series_uid}, false);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(SeriesIntakeTest, TheChoiceWaitsForAllSeriesOfTheStudy) {
  CtSeriesOptions sharp;
  sharp.study_uid = "1.2.840.1";
  CtSeriesOptions soft = sharp;
  soft.kernel = "H30s";
  const CtSeries first = Receive("a", sharp);
  now_ += std::chrono::seconds(20);
  const CtSeries second = Receive("b", soft);
  now_ += std::chrono::seconds(20);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kComplete);
  now_ += std::chrono::seconds(20);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kPassedOver);
  EXPECT_EQ(StateOf(second), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, TheChoiceWaitsForASeriesThatThePacsHasAndHasNotSentYet) {
  CtSeriesOptions sharp;
  sharp.study_uid = "1.2.840.1";
  CtSeriesOptions soft = sharp;
  soft.kernel = "H30s";
  soft.series_uid = "1.2.840.3";
  count_ = 8;
  elsewhere_ = {{.series_uid = soft.series_uid, .modality = "CT", .instances = 8}};
  const CtSeries first = Receive("a", sharp);
  intake_->Ended({first.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kComplete);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kComplete);
  EXPECT_EQ(asked_, 1) << "the PACS is asked when something has changed";
  const CtSeries second = Receive("b", soft);
  intake_->Ended({second.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kPassedOver);
  EXPECT_EQ(StateOf(second), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, TheChoiceWaitsNoLongerThanTheStudyIsQuiet) {
  count_ = 8;
  elsewhere_ = {{.series_uid = "1.2.840.3", .modality = "CT", .instances = 8}};
  const CtSeries series = Receive("a");
  intake_->Ended({series.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kComplete);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, ChoiceDoesNotWaitForSeriesThatNoRuleAccepts) {
  count_ = 8;
  elsewhere_ = {{.series_uid = "1.2.840.3", .modality = "SR", .instances = 1}};
  const CtSeries series = Receive("a");
  intake_->Ended({series.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

// A PACS that forwards what it has while the rest is on its way to it.
class SeriesInTwoPartsTest : public SeriesIntakeTest {
 protected:
  // The first slices, which are all that the PACS has.
  void ReceiveFirst(size_t slices) {
    std::vector<size_t> later;
    for (size_t i = slices; i < 8; ++i) later.push_back(i);
    count_ = static_cast<int64_t>(slices);
    series_ = Receive("a", {}, later);
    intake_->Ended({series_.series_uid}, true);
    Settle();
  }
  void ReceiveRest() {
    for (size_t i = static_cast<size_t>(count_); i < 8; ++i) {
      fs::rename(root_ / ("a" + std::to_string(i)), series_.files[i]);
      intake_->Arrived(series_.files[i], *ReadInstanceHeader(series_.files[i]));
    }
    count_ = 8;
  }
  void EndAssociation() {
    intake_->Ended({series_.series_uid}, true);
    Settle();
  }
  std::string Reason() { return rows_.GetByUid(series_.series_uid)->reason; }
  // As if `plan build` had made it.
  void PutPlan() {
    const fs::path plan = queue_->plan_path(rows_.GetByUid(series_.series_uid)->key);
    fs::create_directories(plan);
    std::ofstream(plan / "plan.json") << "{}";
  }

  CtSeries series_;
};

TEST_F(SeriesInTwoPartsTest, SeriesPassedOverForItsFirstPartIsChosenOnceTheRestArrives) {
  ReceiveFirst(5);
  EXPECT_EQ(StateOf(series_), SeriesState::kPassedOver) << "the rule wants 8 slices";
  ReceiveRest();
  EndAssociation();
  EXPECT_EQ(StateOf(series_), SeriesState::kChosen);
}

class ChosenInTwoPartsTest : public SeriesInTwoPartsTest {
 protected:
  ChosenInTwoPartsTest() {
    SeriesRule rule = SmallRule();
    rule.min_slices = 5;
    UseRule(rule);
  }
};

TEST_F(ChosenInTwoPartsTest, IsReconsideredUntilItsPlanIsBuilt) {
  ReceiveFirst(5);
  EXPECT_EQ(StateOf(series_), SeriesState::kChosen);
  ReceiveRest();
  Settle();
  EXPECT_EQ(StateOf(series_), SeriesState::kReceiving);
  EndAssociation();
  EXPECT_EQ(StateOf(series_), SeriesState::kChosen);
  EXPECT_THAT(Reason(), HasSubstr("8 axial slices"));
}

TEST_F(ChosenInTwoPartsTest, APlanThatWasBuiltOfThePartIsThrownAway) {
  ReceiveFirst(5);
  QueuedSeries series = *rows_.GetByUid(series_.series_uid);
  PutPlan();
  ReceiveRest();
  EndAssociation();
  ASSERT_EQ(StateOf(series_), SeriesState::kChosen);
  PutPlan();  // its builder has not heard of that
  PlanWork work(queue_.get(), server_.get(), {});
  EXPECT_THAT(work.Step(&series), StatusIs(absl::StatusCode::kAborted, HasSubstr("more images")));
  EXPECT_EQ(series.state, SeriesState::kChosen);
  EXPECT_EQ(series.images, 8);
  EXPECT_FALSE(fs::exists(queue_->plan_path(series.key)));
}

TEST_F(ChosenInTwoPartsTest, BuiltPlanStaysAndTheReasonNamesTheMissingImages) {
  ReceiveFirst(5);
  QueuedSeries series = *rows_.GetByUid(series_.series_uid);
  PutPlan();
  PlanWork work(queue_.get(), server_.get(), {});
  ASSERT_THAT(work.Step(&series), IsOk());
  ReceiveRest();
  EXPECT_THAT(*intake_->Settle(), ::testing::ElementsAre(series.key));
  EXPECT_EQ(StateOf(series_), SeriesState::kBuilt);
  EXPECT_THAT(Reason(),
              AllOf(HasSubstr("5 axial slices"), HasSubstr("images arrived after its plan")));
  EXPECT_THAT(*intake_->Settle(), ::testing::IsEmpty()) << "it is told once";
}

TEST_F(ChosenInTwoPartsTest, ACaseHasTheImagesThatItsPlanWasBuiltOf) {
  ReceiveFirst(5);
  const QueuedSeries series = MakeCase(series_);
  ReceiveRest();
  Settle();
  EXPECT_EQ(rows_.ListImages(series.key)->size(), 8);
  const std::vector<QueuedImage> sources = *rows_.ListSources(series.case_name);
  std::vector<std::string> uids;
  uids.reserve(sources.size());
  for (const QueuedImage& image : sources) uids.push_back(image.uid);
  EXPECT_THAT(uids, ::testing::UnorderedElementsAreArray(series_.instance_uids.begin(),
                                                         series_.instance_uids.begin() + 5));
}

TEST_F(SeriesInTwoPartsTest, AnotherRecipeRemovesTheEarlierPlan) {
  ReceiveFirst(8);
  PutPlan();
  const QueuedSeries series = *rows_.GetByUid(series_.series_uid);
  ASSERT_THAT(intake_->Choose(series, "other.json", "chosen manually"), IsOk());
  EXPECT_FALSE(fs::exists(queue_->plan_path(series.key)));
  EXPECT_EQ(rows_.GetByUid(series_.series_uid)->recipe, "other.json");
}

TEST_F(SeriesIntakeTest, ImageOfAnotherStudyIsReportedAndLeftOut) {
  CtSeriesOptions one;
  one.series_uid = "1.2.840.2";
  const CtSeries series = Receive("a", one);
  WaitQuietly();
  Settle();
  ASSERT_EQ(StateOf(series), SeriesState::kChosen);
  Receive("b", one);
  EXPECT_THAT(*intake_->Settle(), ::testing::ElementsAre(rows_.GetByUid(series.series_uid)->key));
  const QueuedSeries kept = *rows_.GetByUid(series.series_uid);
  EXPECT_EQ(kept.images, 8);
  EXPECT_THAT(kept.reason, HasSubstr("name another study"));
}

TEST_F(SeriesIntakeTest, FailsASeriesOfTwoStudies) {
  CtSeriesOptions one;
  one.series_uid = "1.2.840.2";
  const CtSeries series = Receive("a", one);
  Settle();
  Receive("b", one);
  Settle();
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kFailed);
  EXPECT_THAT(rows_.GetByUid(series.series_uid)->reason, HasSubstr("name another study"));
}

TEST_F(SeriesIntakeTest, ChoiceIsReportedOnce) {
  const CtSeries series = Receive("a");
  WaitQuietly();
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> changed, intake_->Settle());
  ASSERT_EQ(StateOf(series), SeriesState::kChosen);
  EXPECT_EQ(changed.size(), 1);
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> again, intake_->Settle());
  EXPECT_TRUE(again.empty());
}

TEST_F(SeriesIntakeTest, FailsASeriesOfTwoPatients) {
  CtSeriesOptions one;
  one.study_uid = "1.2.840.1";
  one.series_uid = "1.2.840.2";
  CtSeriesOptions other = one;
  other.patient_id = "OTHER";
  const CtSeries series = Receive("a", one);
  Receive("b", other);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kFailed);
  EXPECT_THAT(rows_.GetByUid(series.series_uid)->reason, Not(HasSubstr("OTHER")));
}

TEST_F(SeriesIntakeTest, RestartPicksUpTheFilesInTheFolder) {
  const fs::path folder = fs::path(queue_->received_folder()) / "a";
  fs::create_directories(folder);
  const CtSeries series = WriteCtSeries(folder);
  std::ofstream(folder / "x.partial") << "no image";
  ASSERT_THAT(intake_->Recover(), IsOk());
  Settle();
  EXPECT_EQ(rows_.GetByUid(series.series_uid)->images, 8);
}

}  // namespace
}  // namespace tissueform::testing
