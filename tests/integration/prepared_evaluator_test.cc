// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdint>
#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mesh/payload/sha256.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// Prepared answers that a client fetches and evaluates itself, beside those of the server.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

// All messages of a call.
struct Fetched {
  grpc::Status status;
  v1::PreparedAnswersHeader header;
  std::string bytes;
  int64_t first_offset = -1;
};

class PreparedEvaluatorTest : public ServiceTest {
 protected:
  PreparedEvaluatorTest() : client_(Connect()), session_(MakeSession(client_.get(), problem_)) {}

  v1::GetPreparedAnswersRequest Request(int64_t read_offset = 0) const {
    v1::GetPreparedAnswersRequest request;
    request.set_session(session_.name());
    request.mutable_vertices()->mutable_skin();
    request.mutable_prepared();
    request.set_read_offset(read_offset);
    return request;
  }

  Fetched Fetch(const v1::GetPreparedAnswersRequest& request) {
    const auto stub = v1::DeformService::NewStub(OwnChannel());
    grpc::ClientContext context;
    const auto reader = stub->GetPreparedAnswers(&context, request);
    Fetched fetched;
    v1::GetPreparedAnswersResponse message;
    while (reader->Read(&message)) {
      if (message.has_header()) fetched.header = message.header();
      if (!message.has_chunk()) continue;
      EXPECT_LE(message.chunk().data().size(), size_t{1} << 20);
      if (fetched.first_offset < 0) fetched.first_offset = message.chunk().offset();
      fetched.bytes += message.chunk().data();
    }
    fetched.status = reader->Finish();
    return fetched;
  }

  const BarProblem problem_{7};
  const std::unique_ptr<TissueformClient> client_;
  const v1::Session session_;
};

// That it evaluates as the server does is compared by the golden files and by e2e.zero_lag.
TEST_F(PreparedEvaluatorTest, AnswersWithinTheRangeAndSaysWhereItEnds) {
  DeformStream::Options options;
  options.model = v1::DEFORMATION_MODEL_GRADIENT_FIELD;
  options.prepared.emplace().set_max_rotation(0.4);
  ASSERT_OK_AND_ASSIGN(const auto evaluator, client_->FetchPreparedAnswers(session_, options));
  EXPECT_GT(evaluator->header().terms(), 0);
  EXPECT_EQ(evaluator->header().model(), v1::DEFORMATION_MODEL_GRADIENT_FIELD);
  HandlePose pose;
  pose.rotation_vector = {0.1, 0, 0.2};
  pose.translation_mm.x() = 0.5;
  ASSERT_OK_AND_ASSIGN(const auto near, evaluator->Evaluate(TopPose(pose)));
  ASSERT_TRUE(near.has_value());
  const Positions expected = problem_.Solve(pose);
  const Eigen::Map<const FloatPositions> given(near->positions.data(), expected.rows(), 3);
  EXPECT_LE((given.cast<double>() - expected).cwiseAbs().maxCoeff(),
            kFloat32Tolerance + near->error_mm);
  pose.rotation_vector = {0.5, 0, 0};
  ASSERT_OK_AND_ASSIGN(const auto far, evaluator->Evaluate(TopPose(pose)));
  EXPECT_FALSE(far.has_value());
  EXPECT_THAT(evaluator->Evaluate({}), StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(evaluator->Evaluate({{{"bottom", HandlePose{}}}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("top")));
}

TEST_F(PreparedEvaluatorTest, InterruptedDownloadResumesWithTheSameBytes) {
  const Fetched all = Fetch(Request());
  ASSERT_TRUE(all.status.ok()) << all.status.error_message();
  ASSERT_GT(all.bytes.size(), 1000U);
  EXPECT_EQ(all.header.total_bytes(), static_cast<int64_t>(all.bytes.size()));
  EXPECT_EQ(all.header.sha256(), Sha256Hex({all.bytes}));
  EXPECT_EQ(ReadAnswers(all.bytes).message, "");
  const Fetched rest = Fetch(Request(900));
  EXPECT_EQ(rest.header.sha256(), all.header.sha256());
  EXPECT_EQ(rest.first_offset, 900);
  EXPECT_EQ(rest.bytes, all.bytes.substr(900));
  EXPECT_EQ(Fetch(Request(all.header.total_bytes())).bytes, "");
}

TEST_F(PreparedEvaluatorTest, RefusesInvalidRequests) {
  const auto code = [this](const v1::GetPreparedAnswersRequest& request) {
    return Fetch(request).status.error_code();
  };
  EXPECT_EQ(code(Request(-1)), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code(Request(1 << 30)), grpc::StatusCode::INVALID_ARGUMENT);
  v1::GetPreparedAnswersRequest without = Request();
  without.clear_prepared();
  EXPECT_EQ(code(without), grpc::StatusCode::INVALID_ARGUMENT);
  v1::GetPreparedAnswersRequest of_arap = Request();
  of_arap.set_model(v1::DEFORMATION_MODEL_ARAP);
  EXPECT_EQ(code(of_arap), grpc::StatusCode::INVALID_ARGUMENT);
  v1::GetPreparedAnswersRequest unknown = Request();
  unknown.set_session("sessions/unknown");
  EXPECT_EQ(code(unknown), grpc::StatusCode::NOT_FOUND);
  ExpectServes();
}

}  // namespace
}  // namespace tissueform::testing
