// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// What planners want in the PACS, over the network.
namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// No file of it is needed: a server does not check the case that a prediction names.
const std::string kCase = "cases/" + std::string(64, 'c');

v1::Measure SomeMeasure(const std::string& name = "e_line_upper_lip") {
  v1::Measure measure;
  measure.set_name(name);
  measure.set_title("upper lip to E-line");
  measure.set_unit("mm");
  measure.set_before(-2.5);
  measure.set_after(-4);
  measure.set_lowest_after(-4.5);
  measure.set_highest_after(-3.5);
  return measure;
}

v1::UpdateExportRequest Change(const std::string& name, v1::ExportState state,
                               const std::string& detail = "") {
  v1::UpdateExportRequest request;
  request.set_name(name);
  request.set_state(state);
  request.set_detail(detail);
  return request;
}

std::vector<std::string> NamesOf(const std::vector<v1::Export>& exports) {
  std::vector<std::string> names;
  names.reserve(exports.size());
  for (const v1::Export& one : exports) names.push_back(one.name());
  return names;
}

class ExportsTest : public ServiceTest {
 protected:
  void Begin() {
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
  }
  void SetUp() override { Begin(); }

  ExportCalls& exports() { return client_->exports(); }
  std::string Predict(int pose = 1, const std::string& case_name = kCase) {
    const auto made = client_->predictions().Create(session_, TopPose(SomePose(pose)), {}, "",
                                                    {.case_name = case_name});
    EXPECT_THAT(made, IsOk());
    return made.ok() ? made->name() : "";
  }

  const BarProblem problem_{7};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
};

TEST_F(ExportsTest, ExportKeepsItsRequestAndOnlyMovesForward) {
  const std::string prediction = Predict();
  ASSERT_OK_AND_ASSIGN(const v1::Export made, exports().Create(prediction, {SomeMeasure()}));
  EXPECT_EQ(made.prediction(), prediction);
  EXPECT_EQ(made.case_(), kCase);
  EXPECT_EQ(made.state(), v1::EXPORT_STATE_WAITING);
  EXPECT_GT(made.create_time().seconds(), 0);
  ASSERT_EQ(made.measures_size(), 1);
  EXPECT_EQ(made.measures(0).DebugString(), SomeMeasure().DebugString());
  ASSERT_OK_AND_ASSIGN(const v1::Export got, exports().Get(made.name()));
  EXPECT_EQ(got.DebugString(), made.DebugString());
  v1::UpdateExportRequest storing = Change(made.name(), v1::EXPORT_STATE_STORING, "3 of 6");
  storing.set_stored_objects(3);
  storing.set_etag(made.etag());
  ASSERT_OK_AND_ASSIGN(const v1::Export changed, exports().Update(storing));
  EXPECT_EQ(changed.stored_objects(), 3);
  EXPECT_EQ(changed.detail(), "3 of 6");
  EXPECT_NE(changed.etag(), made.etag());
  EXPECT_THAT(exports().Update(storing), Because(ErrorReason::kStaleEtag));
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_WAITING)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("invalid change of state")));
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_STORED)), IsOk());
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_STORED)), IsOk()) << "again";
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_FAILED)),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(ExportsTest, StoringExportMayReturnToConfirmation) {
  ASSERT_OK_AND_ASSIGN(const v1::Export made, exports().Create(Predict()));
  ASSERT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_STORING)), IsOk());
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_CONFIRMATION)), IsOk());
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_WAITING)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("invalid change of state")));
  ASSERT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_STORED)), IsOk());
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_CONFIRMATION)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("invalid change of state")));
}

TEST_F(ExportsTest, OneOfAPredictionThatIsNotDoneIsGivenAgainAndADoneOneIsNot) {
  const std::string prediction = Predict();
  ASSERT_OK_AND_ASSIGN(const v1::Export made, exports().Create(prediction));
  ASSERT_OK_AND_ASSIGN(const v1::Export again, exports().Create(prediction, {SomeMeasure()}));
  EXPECT_EQ(again.name(), made.name());
  ASSERT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_FAILED, "no PACS")), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Export other, exports().Create(prediction, {}, "second"));
  EXPECT_NE(other.name(), made.name());
  ASSERT_THAT(exports().Update(Change(other.name(), v1::EXPORT_STATE_STORED)), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Export repeated, exports().Create(prediction, {}, "second"));
  EXPECT_EQ(repeated.name(), other.name()) << "the same request, done or not";
  EXPECT_THAT(exports().Create(prediction, {SomeMeasure()}, "second"),
              Because(ErrorReason::kRequestIdReused));
  const std::string second = Predict(2);
  ASSERT_OK_AND_ASSIGN(const v1::Export of_second, exports().Create(second));
  ASSERT_OK_AND_ASSIGN(const auto all, exports().List());
  EXPECT_THAT(NamesOf(all), ElementsAre(made.name(), other.name(), of_second.name()))
      << "in the order of their creation";
  ASSERT_OK_AND_ASSIGN(const auto one, exports().List(second));
  EXPECT_THAT(NamesOf(one), ElementsAre(of_second.name()));
  ASSERT_OK_AND_ASSIGN(const auto of_case, exports().List("", "cases/" + std::string(64, 'd')));
  EXPECT_THAT(of_case, IsEmpty());
}

TEST_F(ExportsTest, ErrorsNameThePlaceOfBadMeasuresWithoutTheirText) {
  const std::string prediction = Predict();
  const auto refused = [&](const v1::Measure& measure, const std::string& why) {
    const absl::Status status = exports().Create(prediction, {SomeMeasure(), measure}).status();
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
    EXPECT_THAT(status.message(), ::testing::Not(HasSubstr("Meier")));
  };
  v1::Measure bad = SomeMeasure("Hans Meier");
  refused(bad, "measure 1 has an invalid name");
  refused(SomeMeasure(), "an earlier name");
  bad = SomeMeasure("other");
  bad.set_title("Meier\n");
  refused(bad, "title");
  bad = SomeMeasure("other");
  bad.set_unit("inch");
  refused(bad, "other than mm and deg");
  bad = SomeMeasure("other");
  bad.set_after(std::numeric_limits<double>::quiet_NaN());
  refused(bad, "not finite");
  bad = SomeMeasure("other");
  bad.set_lowest_after(9);
  refused(bad, "interval");
  std::vector<v1::Measure> many;
  many.reserve(65);
  for (int i = 0; i < 65; ++i) many.push_back(SomeMeasure("own_" + std::to_string(i)));
  EXPECT_THAT(exports().Create(prediction, many), StatusIs(absl::StatusCode::kInvalidArgument));
  many.pop_back();
  EXPECT_THAT(exports().Create(prediction, many), IsOk());
  EXPECT_THAT(exports().Create(Predict(2), {}, std::string(65, 'x')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("request_id")));
  EXPECT_THAT(exports().Create("predictions/none"), Because(ErrorReason::kPredictionNotFound));
  EXPECT_THAT(exports().Create("none"), StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(exports().Create(Predict(3, "")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("has no case")));
  EXPECT_THAT(exports().Get("exports/none"), Because(ErrorReason::kExportNotFound));
  EXPECT_THAT(exports().Delete("exports/none"), Because(ErrorReason::kExportNotFound));
  ASSERT_OK_AND_ASSIGN(const auto all, exports().List());
  ASSERT_THAT(all, SizeIs(1));
  EXPECT_THAT(exports().Update(Change(all[0].name(), v1::EXPORT_STATE_UNSPECIFIED)),
              StatusIs(absl::StatusCode::kInvalidArgument));
  for (const std::string& detail : {std::string(257, 'x'), std::string("two\nlines")}) {
    EXPECT_THAT(exports().Update(Change(all[0].name(), v1::EXPORT_STATE_FAILED, detail)),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("detail")));
  }
}

TEST_F(ExportsTest, AWatchSendsWaitingExportsThenEveryChangeAndEndsWithTheServer) {
  ASSERT_OK_AND_ASSIGN(const v1::Export done, exports().Create(Predict(1)));
  ASSERT_THAT(exports().Update(Change(done.name(), v1::EXPORT_STATE_STORED)), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Export waiting, exports().Create(Predict(2)));
  const auto watch = exports().Watch();
  auto received = watch->Receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->export_().name(), waiting.name());
  received = watch->Receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_FALSE(received->has_export_()) << "that was all";
  ASSERT_THAT(exports().Update(Change(waiting.name(), v1::EXPORT_STATE_CONFIRMATION)), IsOk());
  received = watch->Receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->export_().state(), v1::EXPORT_STATE_CONFIRMATION);
  ASSERT_OK_AND_ASSIGN(const v1::Export later, exports().Create(Predict(3)));
  received = watch->Receive();
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->export_().name(), later.name());
  std::thread drain([this] { server().Drain(); });
  EXPECT_EQ(watch->Receive(), std::nullopt);
  EXPECT_THAT(watch->Finish(), Because(ErrorReason::kServerDraining));
  drain.join();
}

TEST_F(ExportsTest, AnExportThatIsWithdrawnOrLosesItsPredictionIsGone) {
  const std::string prediction = Predict(1);
  ASSERT_OK_AND_ASSIGN(const v1::Export made, exports().Create(prediction));
  EXPECT_THAT(exports().Delete(made.name()), IsOk());
  EXPECT_THAT(exports().Get(made.name()), Because(ErrorReason::kExportNotFound));
  EXPECT_THAT(exports().Update(Change(made.name(), v1::EXPORT_STATE_STORED)),
              Because(ErrorReason::kExportNotFound));
  ASSERT_OK_AND_ASSIGN(const v1::Export again, exports().Create(prediction));
  EXPECT_NE(again.name(), made.name());
  ASSERT_THAT(client_->predictions().Delete(prediction), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto all, exports().List());
  EXPECT_THAT(all, IsEmpty());
}

TEST_F(ExportsTest, TooManyAreRefusedAndRoomComesBack) {
  StopServer();
  ServerOptions options = TestOptions();
  options.exports = {.max_waiting = 2, .max_kept = 3, .max_watches = 1};
  StartServer(options);
  Begin();
  ASSERT_OK_AND_ASSIGN(const v1::Export first, exports().Create(Predict(1)));
  ASSERT_THAT(exports().Create(Predict(2)), IsOk());
  const std::string third = Predict(3);
  EXPECT_THAT(exports().Create(third), Because(ErrorReason::kTooManyExports));
  ASSERT_THAT(exports().Update(Change(first.name(), v1::EXPORT_STATE_STORED)), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Export of_third, exports().Create(third));
  ASSERT_THAT(exports().Update(Change(of_third.name(), v1::EXPORT_STATE_STORED)), IsOk());
  EXPECT_THAT(exports().Create(Predict(4)), Because(ErrorReason::kTooManyExports)) << "kept";
  ASSERT_THAT(exports().Delete(first.name()), IsOk());
  EXPECT_THAT(exports().Create(Predict(4)), IsOk());
  const auto watch = exports().Watch();
  ASSERT_TRUE(watch->Receive().has_value());
  const auto other = exports().Watch();
  EXPECT_EQ(other->Receive(), std::nullopt);
  EXPECT_THAT(other->Finish(), Because(ErrorReason::kTooManyWatches));
  watch->Cancel();
  EXPECT_TRUE(Eventually([this] { return server().export_watches().size() == 0; }));
}

TEST(DurableExportsTest, AfterAKillAllIsThereThatWasAcknowledged) {
  DurableServer server("exports");
  ASSERT_THAT(server.Start(), IsOk());
  ASSERT_OK_AND_ASSIGN(auto client, server.Connect());
  const BarProblem problem(7);
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh,
                       client->UploadMesh(problem.mesh, problem.CellArrays(), {}));
  ASSERT_OK_AND_ASSIGN(const v1::Session session,
                       client->CreateSession(problem.Request(mesh.name())));
  const auto predict = [&](int pose) {
    return client->predictions()
        .Create(session.name(), TopPose(SomePose(pose)), {}, "", {.case_name = kCase})
        ->name();
  };
  ASSERT_OK_AND_ASSIGN(const v1::Export first,
                       client->exports().Create(predict(1), {SomeMeasure()}, "one"));
  const std::string gone = predict(2);
  ASSERT_THAT(client->exports().Create(gone), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Export changed,
                       client->exports().Update(Change(first.name(), v1::EXPORT_STATE_STORING)));
  ASSERT_THAT(client->predictions().Delete(gone), IsOk());
  ASSERT_THAT(server.Kill(), IsOk());
  ASSERT_THAT(server.Start(), IsOk());
  ASSERT_OK_AND_ASSIGN(client, server.Connect());
  ASSERT_OK_AND_ASSIGN(const auto kept, client->exports().List());
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_EQ(kept[0].DebugString(), changed.DebugString());
  ASSERT_OK_AND_ASSIGN(const v1::Export again,
                       client->exports().Create(first.prediction(), {SomeMeasure()}, "one"));
  EXPECT_EQ(again.name(), first.name());
}

}  // namespace
}  // namespace tissueform::testing
