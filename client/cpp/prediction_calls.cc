// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/prediction_calls.h"

#include <utility>

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
    return absl::DataLossError("the server's chunks are not contiguous; read them again");
  }

  std::string bytes_;
  int64_t total_bytes_ = 0;
};

// How a call ended of which messages were read; OK when one was not taken, which another attempt
// would not change.
template <typename Message>
grpc::Status EndOf(grpc::ClientReader<Message>* reader, const absl::Status& taken,
                   grpc::ClientContext* context) {
  if (!taken.ok()) context->TryCancel();
  const grpc::Status ended = reader->Finish();
  return taken.ok() ? ended : grpc::Status::OK;
}

}  // namespace

PredictionCalls::PredictionCalls(const std::shared_ptr<grpc::Channel>& channel,
                                 std::chrono::milliseconds call_deadline, SessionRoutes* routes)
    : call_deadline_(call_deadline),
      routes_(routes),
      stub_(v1::PredictionService::NewStub(channel)) {}

absl::Status PredictionCalls::Call(
    const std::string& session, CallRepeat repeat,
    const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
  return RunSessionCall(routes_, session, repeat, std::chrono::system_clock::now() + call_deadline_,
                        attempt);
}

absl::StatusOr<v1::Prediction> PredictionCalls::Create(const std::string& session,
                                                       absl::Span<const NamedPose> poses,
                                                       v1::DeformationModel model,
                                                       const std::string& request_id,
                                                       const PredictionLabel& label) {
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
  const CallRepeat repeat =
      request_id.empty() ? CallRepeat::kIfNothingWasDone : CallRepeat::kAlways;
  TF_RETURN_IF_ERROR(Call(session, repeat, [&](grpc::ClientContext* context) {
    return stub_->CreatePrediction(context, request, &prediction);
  }));
  return prediction;
}

absl::StatusOr<v1::Prediction> PredictionCalls::Get(const std::string& name) {
  v1::GetPredictionRequest request;
  request.set_name(name);
  v1::Prediction prediction;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return stub_->GetPrediction(context, request, &prediction);
  }));
  return prediction;
}

absl::StatusOr<std::vector<v1::Prediction>> PredictionCalls::List(const std::string& session,
                                                                  const std::string& case_name) {
  std::vector<v1::Prediction> predictions;
  v1::ListPredictionsRequest request;
  request.set_session(session);
  request.set_case_(case_name);
  do {
    v1::ListPredictionsResponse response;
    TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
      return stub_->ListPredictions(context, request, &response);
    }));
    predictions.insert(predictions.end(), response.predictions().begin(),
                       response.predictions().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return predictions;
}

absl::Status PredictionCalls::Delete(const std::string& name) {
  v1::DeletePredictionRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(routes_, "", std::chrono::system_clock::now() + call_deadline_,
                     [&](grpc::ClientContext* context) {
                       return stub_->DeletePrediction(context, request, &response);
                     });
}

absl::StatusOr<Positions> PredictionCalls::ReadPositions(const std::string& name) {
  v1::ReadPositionsRequest request;
  request.set_name(name);
  ChunkReader chunks;
  absl::Status taken;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    chunks = ChunkReader();
    const auto reader = stub_->ReadPositions(context, request);
    v1::ReadPositionsResponse response;
    while (taken.ok() && reader->Read(&response)) taken = chunks.Take(response.chunk());
    return EndOf(reader.get(), taken, context);
  }));
  TF_RETURN_IF_ERROR(taken);
  return chunks.Decode();
}

absl::StatusOr<ComparedPredictions> PredictionCalls::Compare(const std::string& name,
                                                             const Other& other, bool differences,
                                                             const AnswerVertices& vertices) {
  v1::ComparePredictionsRequest request;
  request.set_prediction(name);
  if (const auto* prediction = std::get_if<std::string>(&other)) {
    request.set_other_prediction(*prediction);
  } else {
    request.set_other_model(std::get<v1::DeformationModel>(other));
  }
  request.set_differences(differences);
  *request.mutable_vertices() = ToProto(vertices);
  ComparedPredictions compared;
  ChunkReader chunks;
  absl::Status taken;
  TF_RETURN_IF_ERROR(Call("", CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    chunks = ChunkReader();
    const auto reader = stub_->ComparePredictions(context, request);
    v1::ComparePredictionsResponse response;
    while (taken.ok() && reader->Read(&response)) {
      if (response.has_comparison()) {
        compared.comparison = std::move(*response.mutable_comparison());
      } else {
        taken = chunks.Take(response.differences());
      }
    }
    return EndOf(reader.get(), taken, context);
  }));
  TF_RETURN_IF_ERROR(taken);
  if (differences) {
    TF_ASSIGN_OR_RETURN(compared.differences, chunks.Decode());
  }
  return compared;
}

}  // namespace tissueform
