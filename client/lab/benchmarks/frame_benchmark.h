// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/benchmarks/benchmark_report.h"
#include "client/lab/benchmarks/interleaved.h"
#include "client/lab/benchmarks/test_bars.h"
#include "core/base/instruction_set.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/vertex_response.h"

namespace tissueform::benchmarks {

// What a drag frame costs at the skin (the boundary vertices) from prepared answers, beside the
// back-substitution that it takes the place of.
class FrameBenchmark {
 public:
  enum class Kind {
    kBasis,              // gradient field, the bar's one handle
    kBasisThreeHandles,  // gradient field, the handle cut in three
    kElastic,            // linear elasticity, one handle
    kElasticContact,     // the same with contact rows on one side of the bar, beside kElastic
    kNeoHookean,         // in third order, one handle
  };

  // Makes the answers once and checks on each of `sets`, where frames are timed, that they lie
  // within a millionth of the bar's diagonal of the direct ones, or, of neo-Hookean, within their
  // own estimate. `bar` outlives the benchmark. REQUIRES: at least one set, all supported.
  static absl::StatusOr<std::unique_ptr<FrameBenchmark>> Create(const TestBar& bar, Kind kind,
                                                                int threads,
                                                                std::vector<InstructionSet> sets);

  const std::vector<TimedWork>& work() const { return work_; }
  std::vector<BenchmarkRow> Rows(const PartSeconds& medians) const;

 private:
  FrameBenchmark(const TestBar& bar, Kind kind, std::vector<InstructionSet> sets)
      : bar_(bar), kind_(kind), sets_(std::move(sets)) {}

  absl::Status Prepare(int threads);
  bool IsElastic() const { return kind_ != Kind::kBasis && kind_ != Kind::kBasisThreeHandles; }
  absl::Status MakeResponse();
  absl::Status CheckAnswers();
  absl::StatusOr<Positions> DirectAnswer();
  absl::StatusOr<Eigen::MatrixXd> BackSubstitute();
  // What a session does for a frame: asks whether the poses are covered, bounds the error, answers.
  absl::StatusOr<PartSeconds> AnswerFrame(InstructionSet set);
  // What int16 adds to a frame.
  absl::StatusOr<PartSeconds> EncodeFrame();
  void AddWork();
  std::string Name(const std::string& what) const;
  BenchmarkRow FrameRow(const PartSeconds& medians, InstructionSet set) const;

  const TestBar& bar_;
  const Kind kind_;
  const std::vector<InstructionSet> sets_;
  std::vector<int32_t> skin_;
  std::vector<HandlePose> poses_;
  std::shared_ptr<MeshPreparation> preparation_;
  std::unique_ptr<VertexResponse> response_;
  Eigen::MatrixXd rhs_;     // of the back-substitution
  Eigen::MatrixXd values_;  // at the constrained unknowns
  FloatPositions frame_;
  int64_t announced_bytes_ = 0;
  int frames_ = 0;
  size_t encoded_bytes_ = 0;
  std::vector<TimedWork> work_;
};

}  // namespace tissueform::benchmarks
