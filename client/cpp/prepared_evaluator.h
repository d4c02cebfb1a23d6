// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "client/cpp/session_routes.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "proto/conversion/geometry_conversion.h"
#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {

// What poses give without the server.
struct EvaluatedAnswer {
  std::vector<float> positions;  // x y z in mm of every vertex of the question, in its order
  double error_mm = 0;           // a bound; of neo_hookean an estimate
  // Of each vertex; empty unless ranges of the material were asked for, and where a handle turns
  // too far for a band (more than `max_rotation` of what was asked for, or than 30 degrees).
  std::vector<float> band_mm = {};
};

// The prepared answers of one session, model and selection of vertices, fetched from a server and
// evaluated here: frames without a round trip. They are those of the session as it was: fetch them
// again when it was updated.
//
// Constant: any number of threads may ask at once.
class PreparedEvaluator {
 public:
  // Asks for what a stream with the same vertices, model and `prepared` answers from. `handles`:
  // the names of the session's, in its order (v1::Session::handles).
  //
  // Errors: the server's; DataLoss (bytes that are not contiguous, do not match the announced
  // SHA-256, or cannot be evaluated with these handles).
  static absl::StatusOr<std::unique_ptr<PreparedEvaluator>> Fetch(
      v1::DeformService::Stub* stub, const v1::GetPreparedAnswersRequest& request,
      std::vector<std::string> handles, SessionRoutes* routes,
      std::chrono::system_clock::time_point deadline);

  const v1::PreparedAnswersHeader& header() const { return header_; }
  const AnswerEvaluator& evaluator() const { return evaluator_; }

  // Empty beyond the prepared range: ask the server then. Errors: InvalidArgument unless there is
  // one pose for every handle.
  absl::StatusOr<std::optional<EvaluatedAnswer>> Evaluate(absl::Span<const NamedPose> poses) const;

 private:
  PreparedEvaluator(v1::PreparedAnswersHeader header, std::vector<std::string> handles,
                    PortableAnswers answers);

  const v1::PreparedAnswersHeader header_;
  const std::vector<std::string> handles_;
  const AnswerEvaluator evaluator_;
};

}  // namespace tissueform
