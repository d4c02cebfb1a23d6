// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_answer_calls.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <utility>

#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "tests/integration/model_choices.h"

namespace tissueform::testing {
namespace {

absl::Status TakePrediction(ModelState& state, const v1::Prediction& reported,
                            ServedPrediction prediction) {
  const std::string& request_id = prediction.request_id;
  if (!request_id.empty()) {
    const auto [named, first] = state.model.names_of_requests.emplace(request_id, reported.name());
    if (!first && named->second != reported.name()) return Wrong("another name of one request");
  }
  if (reported.session() != prediction.session ||
      reported.mesh() != NameOfMesh(prediction.key.mesh) ||
      reported.model() != prediction.key.model) {
    return Wrong(reported.DebugString());
  }
  if (!state.model.predictions.emplace(reported.name(), std::move(prediction)).second) {
    return Wrong(reported.name(), " comes again");
  }
  TF_ASSIGN_OR_RETURN(const Positions answer,
                      state.client->predictions().ReadPositions(reported.name()));
  return state.answers.Check(state.model.predictions.at(reported.name()).key, answer);
}

}  // namespace

absl::Status DragOnce(TissueformClient* client, const std::string& session,
                      const std::string& handle, const std::vector<int>& poses, uint32_t commits,
                      const CheckFrame& check, uint64_t* committed) {
  absl::Status wrong;
  DeformStream::Options options;
  options.on_notice = [&](const v1::DeformNotice& notice) {
    if (!notice.has_committed()) return;
    if (!notice.committed().failure().empty()) wrong = Wrong(notice.committed().failure());
    *committed = notice.committed().sequence();
  };
  TF_ASSIGN_OR_RETURN(const auto stream, client->OpenStream(session, options));
  for (size_t i = 0; i < poses.size(); ++i) {
    // One that fails has ended the stream, and Finish says why.
    stream->SendPoses(i + 1, {{handle, SomePose(poses[i])}}, (commits >> i & 1) != 0).IgnoreError();
  }
  stream->CloseSending();
  uint64_t last = 0;
  while (const std::optional<v1::DeformFrame> frame = stream->Receive()) {
    last = frame->sequence();
    if (wrong.ok()) wrong = check(*frame);
  }
  TF_RETURN_IF_ERROR(stream->Finish());
  TF_RETURN_IF_ERROR(wrong);
  return last == poses.size() ? absl::OkStatus() : Wrong("the last pose has no answer");
}

absl::Status DeformOnce(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomeSession(numbers[0]);
  const int pose = SomePoseNumber(numbers[1]);
  const v1::DeformationModel model = SomeModel(numbers[2]);
  ServedSession* session = state.model.Find(name);
  const bool knows_handle = session != nullptr && numbers[3] % 8 != 0;
  const std::string handle = knows_handle ? session->handle() : "nobody";
  state.Log("DeformOnce(", name, ", ", handle, ": pose ", pose, ", model ", model, ")");
  const bool legal = knows_handle && model != kNoModel;
  Outcome expected = state.model.OfSession(name);
  if (expected.ok() && !legal) expected = kInvalidRequest;
  const auto reported = state.client->DeformOnce(name, {{handle, SomePose(pose)}}, {}, model);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  if (session != nullptr) session->ready = true;
  if (!reported.ok()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const Positions answer,
                      DecodePositions(reported->positions(), MeshOfModel(0).mesh.num_vertices()));
  return state.answers.Check(KeyOf(*session, model, pose), answer);
}

absl::Status Drag(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomeSession(numbers[0]);
  std::vector<int> poses;
  for (uint32_t i = 0; i < 1 + numbers[1] % 4; ++i) poses.push_back(SomePoseNumber(numbers[2] + i));
  const uint32_t commits = numbers[3] & ((1U << poses.size()) - 1);
  state.Log("Deform(", name, ", poses ", absl::StrJoin(poses, " "), ", commits ", commits, ")");
  ServedSession* session = state.model.Find(name);
  uint64_t committed = 0;
  const absl::Status status = DragOnce(
      state.client.get(), name, session == nullptr ? "" : session->handle(), poses, commits,
      [&](const v1::DeformFrame& frame) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const Positions answer,
                            DecodePositions(frame.positions(), MeshOfModel(0).mesh.num_vertices()));
        return state.answers.Check(KeyOf(*session, kOwnModel, poses.at(frame.sequence() - 1)),
                                   answer);
      },
      &committed);
  TF_RETURN_IF_ERROR(CheckOutcome(state.model.OfSession(name), status));
  if (session == nullptr) return absl::OkStatus();
  session->ready = true;
  const auto last = static_cast<uint64_t>(std::bit_width(commits));
  if (committed != last) return Wrong("committed up to ", committed, " of ", last);
  if (last > 0) session->pose = poses[last - 1];
  return absl::OkStatus();
}

absl::Status CreatePrediction(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomeSession(numbers[0]);
  const v1::DeformationModel model = SomeModel(numbers[2]);
  const int pose = SomePoseNumber(numbers[1]);
  ServedSession* session = state.model.Find(name);
  const std::string handle = session == nullptr ? "top" : session->handle();
  std::string request_id;
  if (numbers[3] % 8 < 3) request_id = absl::StrCat("prediction-", numbers[3] % 8);
  if (numbers[3] % 32 == 7) request_id = std::string(65, 'x');
  state.Log("CreatePrediction(", name, ", ", handle, ": pose ", pose, ", model ", model,
            ", request_id \"", request_id, "\")");
  v1::CreatePredictionRequest request;
  request.set_session(name);
  *request.add_poses() = ToProto(NamedPose{handle, SomePose(pose)});
  request.set_model(model);
  const std::string fingerprint = RequestFingerprint(request);
  std::string joined;
  const Outcome expected =
      state.model.OfCreatePrediction(name, request_id, fingerprint, model != kNoModel, &joined);
  const bool reaches_session = state.model.FindPredictionOfRequest(request_id) == nullptr &&
                               request_id.size() <= 64 && session != nullptr;
  const absl::StatusOr<v1::Prediction> reported =
      state.client->predictions().Create(name, {{handle, SomePose(pose)}}, model, request_id);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  if (reaches_session) session->ready = true;
  if (!reported.ok()) return absl::OkStatus();
  if (!joined.empty()) return CheckSame(state.model.predictions.at(joined).reported, *reported);
  return TakePrediction(state, *reported,
                        {.key = KeyOf(*session, model, pose),
                         .session = name,
                         .request_id = request_id,
                         .fingerprint = fingerprint,
                         .reported = *reported});
}

absl::Status ReadPrediction(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomePrediction(numbers[0]);
  state.Log("GetPrediction and ReadPositions(", name, ")");
  const Outcome expected = state.model.OfPrediction(name);
  const absl::StatusOr<v1::Prediction> reported = state.client->predictions().Get(name);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  const absl::StatusOr<Positions> answer = state.client->predictions().ReadPositions(name);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, answer.status()));
  if (!expected.ok()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(CheckSame(state.model.predictions.at(name).reported, *reported));
  return state.answers.Check(state.model.predictions.at(name).key, *answer);
}

absl::Status ListPredictions(ModelState& state, const Numbers& numbers) {
  v1::ListPredictionsRequest request;
  request.set_page_size(SomePageSize(numbers[0]));
  if (numbers[1] % 2 == 0) request.set_session(state.SomeSession(numbers[2]));
  state.Log("ListPredictions(", request.page_size(), ", ", request.session(), ")");
  const auto names = ReadPages<v1::ListPredictionsRequest, v1::ListPredictionsResponse>(
      request,
      [&state](grpc::ClientContext* context, const v1::ListPredictionsRequest& page_request,
               v1::ListPredictionsResponse* page) {
        return state.predictions->ListPredictions(context, page_request, page);
      },
      [](const v1::ListPredictionsResponse& page) {
        std::vector<std::string> of_page;
        for (const v1::Prediction& one : page.predictions()) of_page.push_back(one.name());
        return of_page;
      });
  // Sessions that are gone still have predictions.
  const bool bad_name = state.model.OfSession(request.session()).code == kInvalidRequest.code;
  std::vector<std::string> expected;
  for (const auto& [name, prediction] : state.model.predictions) {
    if (request.session().empty() || prediction.session == request.session()) {
      expected.push_back(name);
    }
  }
  return CheckPages(bad_name ? -1 : request.page_size(), names, expected);
}

absl::Status DeletePrediction(ModelState& state, const Numbers& numbers) {
  const std::string name = state.SomePrediction(numbers[0]);
  state.Log("DeletePrediction(", name, ")");
  TF_RETURN_IF_ERROR(
      CheckOutcome(state.model.OfPrediction(name), state.client->predictions().Delete(name)));
  state.model.predictions.erase(name);
  return absl::OkStatus();
}

absl::Status ComparePredictions(ModelState& state, const Numbers& numbers) {
  const std::string one = state.SomePrediction(numbers[0]);
  const bool with_model = numbers[1] % 2 == 0;
  const std::string other = with_model ? "" : state.SomePrediction(numbers[2]);
  state.Log("ComparePredictions(", one, ", ", with_model ? "linear_elastic" : other, ")");
  const Outcome expected =
      with_model ? state.model.OfCompareModel(one) : state.model.OfCompare(one, other);
  PredictionCalls& calls = state.client->predictions();
  const absl::StatusOr<ComparedPredictions> reported =
      with_model ? calls.Compare(one, v1::DEFORMATION_MODEL_LINEAR_ELASTIC, true)
                 : calls.Compare(one, other, true);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  const auto known = state.model.predictions.find(one);
  if (known == state.model.predictions.end()) return absl::OkStatus();
  ServedSession* session = with_model ? state.model.Find(known->second.session) : nullptr;
  if (session != nullptr) session->ready = true;
  if (!reported.ok()) return absl::OkStatus();
  AnswerQuestionKey key = known->second.key;
  const Positions& from = *state.answers.Find(key);
  if (with_model) {
    key.model = v1::DEFORMATION_MODEL_LINEAR_ELASTIC;
  } else {
    key = state.model.predictions.at(other).key;
  }
  const Positions* to = state.answers.Find(key);
  if (to == nullptr) return absl::OkStatus();  // no call has asked for it
  const double largest = (*to - from).rowwise().norm().maxCoeff();
  const double reported_largest = reported->comparison.distances().max_mm();
  if (reported_largest == largest) return absl::OkStatus();
  return Wrong("the distance is ", largest, " mm, but the server says ", reported_largest);
}

}  // namespace tissueform::testing
