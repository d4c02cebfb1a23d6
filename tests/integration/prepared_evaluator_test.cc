// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mesh/payload/sha256.h"
#include "tests/integration/service_test.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

// Prepared answers that a client fetches and evaluates itself, beside those of the server.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr double kAgreementMm = 1e-4;

DeformStream::Options OptionsOf(v1::DeformationModel model) {
  DeformStream::Options options;
  options.model = model;
  options.vertices = {.kind = AnswerVertices::Kind::kSkin, .list = {}};
  options.prepared.emplace().set_max_rotation(0.4);
  return options;
}

HandlePose RandomPose(RandomNumbers* random) {
  HandlePose pose;
  for (int axis = 0; axis < 3; ++axis) {
    pose.rotation_vector[axis] = 0.2 * random->Next();
    pose.pivot_mm[axis] = 5 * random->Next();
    pose.translation_mm[axis] = random->Next();
  }
  return pose;
}

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

struct EvaluatedModel {
  const char* name;
  v1::DeformationModel model;
};

class PreparedEvaluatorOfModelTest : public PreparedEvaluatorTest,
                                     public ::testing::WithParamInterface<EvaluatedModel> {
 protected:
  // The first frame that answers the pose.
  static std::optional<v1::DeformFrame> Ask(DeformStream* stream, uint64_t sequence,
                                            const HandlePose& pose) {
    EXPECT_THAT(stream->SendPoses(sequence, TopPose(pose)), IsOk());
    for (;;) {
      std::optional<v1::DeformFrame> frame = stream->Receive();
      if (!frame.has_value()) return frame;
      EXPECT_THAT(stream->Ack(*frame), IsOk());
      if (frame->sequence() == sequence && frame->refinement() == 0) return frame;
    }
  }
};

TEST_P(PreparedEvaluatorOfModelTest, AThousandPosesGiveWhatTheServerGives) {
  const DeformStream::Options options = OptionsOf(GetParam().model);
  ASSERT_OK_AND_ASSIGN(const auto evaluator, client_->FetchPreparedAnswers(session_, options));
  ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_.name(), options));
  EXPECT_EQ(evaluator->header().terms(), stream->started().prepared_terms());
  EXPECT_EQ(evaluator->header().model(), GetParam().model);
  RandomNumbers random(17);
  int prepared = 0;
  for (uint64_t i = 1; i <= 1000; ++i) {
    const HandlePose pose = RandomPose(&random);
    const auto frame = Ask(stream.get(), i, pose);
    ASSERT_TRUE(frame.has_value());
    ASSERT_OK_AND_ASSIGN(const auto answer, evaluator->Evaluate(TopPose(pose)));
    if (!frame->summary().prepared() || !answer.has_value()) continue;
    ++prepared;
    ASSERT_OK_AND_ASSIGN(const Positions expected,
                         DecodePositions(frame->positions(), stream->started().vertex_count()));
    ASSERT_EQ(answer->positions.size(), static_cast<size_t>(expected.size()));
    const Eigen::Map<const FloatPositions> positions(answer->positions.data(), expected.rows(), 3);
    ASSERT_LE((positions.cast<double>() - expected).cwiseAbs().maxCoeff(),
              kAgreementMm + frame->summary().error_bound_mm())
        << "pose " << i;
  }
  EXPECT_GT(prepared, 900) << "of poses that are meant to be covered";
}

INSTANTIATE_TEST_SUITE_P(
    Models, PreparedEvaluatorOfModelTest,
    ::testing::Values(EvaluatedModel{"gradient_field", v1::DEFORMATION_MODEL_GRADIENT_FIELD},
                      EvaluatedModel{"linear_elastic", v1::DEFORMATION_MODEL_LINEAR_ELASTIC},
                      EvaluatedModel{"neo_hookean", v1::DEFORMATION_MODEL_NEO_HOOKEAN}),
    [](const auto& test) { return test.param.name; });

TEST_F(PreparedEvaluatorTest, BeyondTheRangeItSaysSo) {
  ASSERT_OK_AND_ASSIGN(
      const auto evaluator,
      client_->FetchPreparedAnswers(session_, OptionsOf(v1::DEFORMATION_MODEL_GRADIENT_FIELD)));
  HandlePose far;
  far.rotation_vector.x() = 0.5;
  ASSERT_OK_AND_ASSIGN(const auto answer, evaluator->Evaluate(TopPose(far)));
  EXPECT_FALSE(answer.has_value());
  EXPECT_THAT(evaluator->Evaluate({}), StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(evaluator->Evaluate({{{"bottom", HandlePose{}}}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("top")));
}

TEST_F(PreparedEvaluatorTest, ACallThatBrokeOffGoesOnWithTheSameBytes) {
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

TEST_F(PreparedEvaluatorTest, WhatCannotBeGivenIsRefused) {
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
