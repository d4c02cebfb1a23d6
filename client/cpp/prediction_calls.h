// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "grpcpp/channel.h"

#include "client/cpp/session_call.h"
#include "core/base/types.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "tissueform/v1/prediction_service.grpc.pb.h"

namespace tissueform {

// How two answers at one mesh differ.
struct ComparedPredictions {
  v1::PredictionComparison comparison;
  // #vertices by 3, of those compared, the other minus the first, in mm; empty unless asked for.
  Positions differences;
};

// What a planner says of a prediction.
struct PredictionLabel {
  std::string case_name = {};  // "cases/{sha256}" that it was planned in
  std::string title = {};
};

// What a server keeps of answers: the rpcs of PredictionService. Got from TissueformClient, whose
// contract it shares: calls block, each with a deadline, and errors carry the server's code,
// message and reason.
//
// Thread-safe.
class PredictionCalls {
 public:
  PredictionCalls(const std::shared_ptr<grpc::Channel>& channel,
                  std::chrono::milliseconds call_deadline, SessionRoutes* routes);

  // Solves and keeps. `model` is the session's own when unspecified. With a `request_id` the call
  // may be repeated: it gives the same prediction again.
  absl::StatusOr<v1::Prediction> Create(
      const std::string& session, absl::Span<const NamedPose> poses,
      v1::DeformationModel model = v1::DEFORMATION_MODEL_UNSPECIFIED,
      const std::string& request_id = "", const PredictionLabel& label = {});

  absl::StatusOr<v1::Prediction> Get(const std::string& name);
  // All of them, page after page; of one session or of one case where they are named.
  absl::StatusOr<std::vector<v1::Prediction>> List(const std::string& session = "",
                                                   const std::string& case_name = "");
  absl::Status Delete(const std::string& name);

  // Of all vertices, #V by 3. Errors: DataLoss also when chunks are missing.
  absl::StatusOr<Positions> ReadPositions(const std::string& name);

  // `other` is the name of a prediction, or a model that the first one's session is asked for.
  // Statistics and differences are of `vertices`.
  using Other = std::variant<std::string, v1::DeformationModel>;
  absl::StatusOr<ComparedPredictions> Compare(const std::string& name, const Other& other,
                                              bool differences = false,
                                              const AnswerVertices& vertices = {});

 private:
  absl::Status Call(const std::string& session, CallRepeat repeat,
                    const std::function<grpc::Status(grpc::ClientContext*)>& attempt);

  const std::chrono::milliseconds call_deadline_;
  SessionRoutes* const routes_;
  const std::unique_ptr<v1::PredictionService::Stub> stub_;
};

}  // namespace tissueform
