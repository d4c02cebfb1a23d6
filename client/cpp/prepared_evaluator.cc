// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/prepared_evaluator.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/cpp/session_call.h"
#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

absl::Status Damaged(absl::string_view what) {
  return absl::DataLossError(absl::StrCat("the prepared answers ", what, "; fetch them again"));
}

struct FetchedAnswers {
  v1::PreparedAnswersHeader header;
  std::string bytes;
};

// The next message of the stream.
absl::Status TakeMessage(const v1::GetPreparedAnswersResponse& message, FetchedAnswers* fetched) {
  if (message.has_header()) {
    fetched->header = message.header();
    const int64_t total = message.header().total_bytes();
    if (total < 0 || total > static_cast<int64_t>(kMaxAnswerBytes)) {
      return absl::DataLossError(absl::StrCat("the prepared answers have ", total,
                                              " bytes; at most ", kMaxAnswerBytes, " are read"));
    }
    return absl::OkStatus();
  }
  if (message.chunk().offset() != static_cast<int64_t>(fetched->bytes.size())) {
    return Damaged("have chunks that are not contiguous");
  }
  fetched->bytes += message.chunk().data();
  if (static_cast<int64_t>(fetched->bytes.size()) > fetched->header.total_bytes()) {
    return Damaged("are longer than announced");
  }
  return absl::OkStatus();
}

absl::StatusOr<FetchedAnswers> FetchBytes(v1::DeformService::Stub* stub,
                                          const v1::GetPreparedAnswersRequest& request,
                                          SessionRoutes* routes,
                                          std::chrono::system_clock::time_point deadline) {
  FetchedAnswers fetched;
  absl::Status taken;
  const auto fetch = [&](grpc::ClientContext* context) {
    const auto reader = stub->GetPreparedAnswers(context, request);
    fetched = {};
    v1::GetPreparedAnswersResponse message;
    while (taken.ok() && reader->Read(&message)) taken = TakeMessage(message, &fetched);
    if (!taken.ok()) context->TryCancel();
    const grpc::Status ended = reader->Finish();
    return taken.ok() ? ended : grpc::Status::OK;  // what was not taken is not fetched again
  };
  TF_RETURN_IF_ERROR(
      RunSessionCall(routes, request.session(), CallRepeat::kAlways, deadline, fetch));
  TF_RETURN_IF_ERROR(taken);
  if (Sha256Hex({fetched.bytes}) != fetched.header.sha256()) {
    return Damaged("are incomplete, or do not match the announced SHA-256");
  }
  return fetched;
}

}  // namespace

absl::StatusOr<std::unique_ptr<PreparedEvaluator>> PreparedEvaluator::Fetch(
    v1::DeformService::Stub* stub, const v1::GetPreparedAnswersRequest& request,
    std::vector<std::string> handles, SessionRoutes* routes,
    std::chrono::system_clock::time_point deadline) {
  TF_ASSIGN_OR_RETURN(FetchedAnswers fetched, FetchBytes(stub, request, routes, deadline));
  AnswerReading reading = ReadAnswers(fetched.bytes);
  if (reading.error != AnswerError::kNone) return absl::DataLossError(reading.message);
  if (reading.answers.numbers.num_handles != static_cast<double>(handles.size())) {
    return Damaged("belong to a session with other handles");
  }
  return std::unique_ptr<PreparedEvaluator>(new PreparedEvaluator(
      std::move(fetched.header), std::move(handles), std::move(reading.answers)));
}

PreparedEvaluator::PreparedEvaluator(v1::PreparedAnswersHeader header,
                                     std::vector<std::string> handles, PortableAnswers answers)
    : header_(std::move(header)), handles_(std::move(handles)), evaluator_(std::move(answers)) {}

absl::StatusOr<std::optional<EvaluatedAnswer>> PreparedEvaluator::Evaluate(
    absl::Span<const NamedPose> poses) const {
  std::vector<AnswerPose> in_order;
  for (const std::string& handle : handles_) {
    const auto named = [&handle](const NamedPose& pose) { return pose.handle == handle; };
    const auto found = std::find_if(poses.begin(), poses.end(), named);
    if (found == poses.end() || poses.size() != handles_.size()) {
      return absl::InvalidArgumentError(absl::StrCat(
          poses.size(), " poses, and none or more than one for handle \"", handle,
          "\" or another; give one for each of the session's ", handles_.size(), " handles"));
    }
    const HandlePose& pose = found->pose;
    AnswerPose& answer = in_order.emplace_back();
    std::copy_n(pose.rotation_vector.data(), 3, answer.rotation_vector.begin());
    std::copy_n(pose.pivot_mm.data(), 3, answer.pivot_mm.begin());
    std::copy_n(pose.translation_mm.data(), 3, answer.translation_mm.begin());
    answer.scale = pose.scale;
  }
  EvaluatedAnswer answer;
  if (!evaluator_.Answer(in_order, &answer.positions, &answer.error_mm)) {
    return std::optional<EvaluatedAnswer>();
  }
  evaluator_.Band(in_order, &answer.band_mm);
  return std::optional<EvaluatedAnswer>(std::move(answer));
}

}  // namespace tissueform
