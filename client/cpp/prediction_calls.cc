// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/prediction_calls.h"

#include <utility>

#include "client/cpp/client_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int64_t kVertexBytes = 12;

// Chunks follow each other from the first byte to the last.
class ChunkReader {
 public:
  absl::Status Take(const v1::PositionChunk& chunk) {
    if (chunk.offset() != static_cast<int64_t>(bytes_.size())) return Incomplete();
    total_bytes_ = chunk.total_bytes();
    bytes_ += chunk.data();
    return absl::OkStatus();
  }

  absl::StatusOr<Positions> Decode() const {
    const auto size = static_cast<int64_t>(bytes_.size());
    if (size != total_bytes_ || size % kVertexBytes != 0) return Incomplete();
    return DecodePositions(bytes_, size / kVertexBytes);
  }

 private:
  static absl::Status Incomplete() {
    return absl::DataLossError("the server's chunks do not follow each other; read them again");
  }

  std::string bytes_;
  int64_t total_bytes_ = 0;
};

}  // namespace

PredictionCalls::PredictionCalls(const std::shared_ptr<grpc::Channel>& channel,
                                 std::chrono::milliseconds call_deadline)
    : call_deadline_(call_deadline), stub_(v1::PredictionService::NewStub(channel)) {}

void PredictionCalls::SetDeadline(grpc::ClientContext* context) const {
  context->set_deadline(std::chrono::system_clock::now() + call_deadline_);
}

absl::StatusOr<v1::Prediction> PredictionCalls::Create(const std::string& session,
                                                       absl::Span<const NamedPose> poses,
                                                       v1::DeformationModel model,
                                                       const std::string& request_id,
                                                       const PredictionLabel& label) {
  grpc::ClientContext context;
  SetDeadline(&context);
  AddSessionHeader(session, &context);
  v1::CreatePredictionRequest request;
  request.set_session(session);
  for (const NamedPose& pose : poses) {
    *request.add_poses() = ToProto(pose);
  }
  request.set_model(model);
  request.set_request_id(request_id);
  request.set_case_(label.case_name);
  request.set_title(label.title);
  v1::Prediction prediction;
  TF_RETURN_IF_ERROR(FromGrpcStatus(stub_->CreatePrediction(&context, request, &prediction)));
  return prediction;
}

absl::StatusOr<v1::Prediction> PredictionCalls::Get(const std::string& name) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::GetPredictionRequest request;
  request.set_name(name);
  v1::Prediction prediction;
  TF_RETURN_IF_ERROR(FromGrpcStatus(stub_->GetPrediction(&context, request, &prediction)));
  return prediction;
}

absl::StatusOr<std::vector<v1::Prediction>> PredictionCalls::List(const std::string& session,
                                                                  const std::string& case_name) {
  std::vector<v1::Prediction> predictions;
  v1::ListPredictionsRequest request;
  request.set_session(session);
  request.set_case_(case_name);
  do {
    grpc::ClientContext context;
    SetDeadline(&context);
    v1::ListPredictionsResponse response;
    TF_RETURN_IF_ERROR(FromGrpcStatus(stub_->ListPredictions(&context, request, &response)));
    predictions.insert(predictions.end(), response.predictions().begin(),
                       response.predictions().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return predictions;
}

absl::Status PredictionCalls::Delete(const std::string& name) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::DeletePredictionRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return FromGrpcStatus(stub_->DeletePrediction(&context, request, &response));
}

absl::StatusOr<Positions> PredictionCalls::ReadPositions(const std::string& name) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ReadPositionsRequest request;
  request.set_name(name);
  const auto reader = stub_->ReadPositions(&context, request);
  ChunkReader chunks;
  absl::Status taken;
  v1::ReadPositionsResponse response;
  while (taken.ok() && reader->Read(&response)) {
    taken = chunks.Take(response.chunk());
  }
  if (!taken.ok()) context.TryCancel();
  const absl::Status ended = FromGrpcStatus(reader->Finish());
  TF_RETURN_IF_ERROR(taken);
  TF_RETURN_IF_ERROR(ended);
  return chunks.Decode();
}

absl::StatusOr<ComparedPredictions> PredictionCalls::Compare(const std::string& name,
                                                             const Other& other, bool differences,
                                                             const AnswerVertices& vertices) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ComparePredictionsRequest request;
  request.set_prediction(name);
  if (const auto* prediction = std::get_if<std::string>(&other)) {
    request.set_other_prediction(*prediction);
  } else {
    request.set_other_model(std::get<v1::DeformationModel>(other));
  }
  request.set_differences(differences);
  *request.mutable_vertices() = ToProto(vertices);
  const auto reader = stub_->ComparePredictions(&context, request);
  ComparedPredictions compared;
  ChunkReader chunks;
  absl::Status taken;
  v1::ComparePredictionsResponse response;
  while (taken.ok() && reader->Read(&response)) {
    if (response.has_comparison()) {
      compared.comparison = std::move(*response.mutable_comparison());
    } else {
      taken = chunks.Take(response.differences());
    }
  }
  if (!taken.ok()) context.TryCancel();
  const absl::Status ended = FromGrpcStatus(reader->Finish());
  TF_RETURN_IF_ERROR(taken);
  TF_RETURN_IF_ERROR(ended);
  if (differences) {
    TF_ASSIGN_OR_RETURN(compared.differences, chunks.Decode());
  }
  return compared;
}

}  // namespace tissueform
