// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/frame_benchmark.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mesh/payload/displacement_codec.h"
#include "core/mesh/tet_topology.h"

namespace tissueform::benchmarks {
namespace {

constexpr int kFramesPerRepetition = 100;
constexpr double kDegree = std::numbers::pi / 180;

double Diagonal(const TetMesh& mesh) {
  return (mesh.positions().colwise().maxCoeff() - mesh.positions().colwise().minCoeff()).norm();
}

// The bar's handle cut into three along x.
absl::StatusOr<ConstraintSet> ThreeHandles(const TestBar& bar) {
  const Positions& rest = bar.mesh.positions();
  const double low = rest.col(0).minCoeff();
  const double width = rest.col(0).maxCoeff() - low;
  std::vector<HandleRegion> handles = {{"left", {}}, {"middle", {}}, {"right", {}}};
  for (const int32_t vertex : bar.ends.handles().front().vertices) {
    const double part = 3 * (rest(vertex, 0) - low) / width;
    handles[static_cast<size_t>(std::min(2.0, part))].vertices.push_back(vertex);
  }
  return ConstraintSet::Create(bar.mesh, bar.ends.fixed(), std::move(handles));
}

// As many as a face has where lips and teeth may lift off.
constexpr int kContactRows = 206;

// The bar beside a wall that rests, at y = 0, a hundredth of a millimeter away.
absl::StatusOr<ConstraintSet> BesideAWall(const TestBar& bar) {
  std::vector<int32_t> side;
  for (int32_t v = 0; v < bar.mesh.num_vertices(); ++v) {
    if (bar.mesh.positions()(v, 1) == 0) side.push_back(v);
  }
  for (const int32_t constrained : bar.ends.constrained()) std::erase(side, constrained);
  const size_t step = std::max<size_t>(1, side.size() / kContactRows);
  std::vector<ContactRow> rows;
  for (size_t i = 0; i < side.size() && rows.size() < kContactRows; i += step) {
    rows.push_back({.vertex = side[i], .normal = Eigen::Vector3d::UnitY(), .gap_mm = 0.01});
  }
  return ConstraintSet::Create(bar.mesh, bar.ends.fixed(), bar.ends.handles(), std::move(rows));
}

// A drag's pose, turned by as much as is prepared.
std::vector<HandlePose> TurnedPoses(const TestBar& bar, size_t handles) {
  const Eigen::Vector3d axes[] = {{0, 0, 30}, {0, 20, 20}, {-15, 0, 25}};
  std::vector<HandlePose> poses(handles);
  for (size_t h = 0; h < handles; ++h) {
    poses[h].rotation_vector = axes[h] * kDegree;
    poses[h].pivot_mm = bar.mesh.positions().colwise().mean().transpose();
    poses[h].translation_mm = {1, 0.5, 2};
  }
  return poses;
}

DeformationModel ModelOf(FrameBenchmark::Kind kind) {
  switch (kind) {
    case FrameBenchmark::Kind::kBasis:
    case FrameBenchmark::Kind::kBasisThreeHandles:
      break;
    case FrameBenchmark::Kind::kElastic:
    case FrameBenchmark::Kind::kElasticContact:
      return DeformationModel::kLinearElastic;
    case FrameBenchmark::Kind::kNeoHookean:
      return DeformationModel::kNeoHookean;
  }
  return DeformationModel::kGradientField;
}

Eigen::MatrixXd Interleaved(const Positions& displacements) {
  return Eigen::Map<const Eigen::VectorXd>(displacements.data(), displacements.size());
}

}  // namespace

absl::StatusOr<std::unique_ptr<FrameBenchmark>> FrameBenchmark::Create(
    const TestBar& bar, Kind kind, int threads, std::vector<InstructionSet> sets) {
  auto benchmark = absl::WrapUnique(new FrameBenchmark(bar, kind, std::move(sets)));
  TF_RETURN_IF_ERROR(benchmark->Prepare(threads));
  TF_RETURN_IF_ERROR(benchmark->MakeResponse());
  TF_RETURN_IF_ERROR(benchmark->CheckAnswers());
  benchmark->AddWork();
  return benchmark;
}

absl::Status FrameBenchmark::Prepare(int threads) {
  skin_ = BoundaryVertices(bar_.mesh);
  ConstraintSet constraints = bar_.ends;
  if (kind_ == Kind::kBasisThreeHandles) {
    TF_ASSIGN_OR_RETURN(constraints, ThreeHandles(bar_));
  } else if (kind_ == Kind::kElasticContact) {
    TF_ASSIGN_OR_RETURN(constraints, BesideAWall(bar_));
  }
  poses_ = TurnedPoses(bar_, constraints.handles().size());
  PreparationOptions options;
  options.threads = threads;
  TF_ASSIGN_OR_RETURN(preparation_,
                      MeshPreparation::Create(bar_.mesh, bar_.stiffness, constraints, options));
  return absl::OkStatus();
}

absl::Status FrameBenchmark::MakeResponse() {
  ResponseOptions options{.model = ModelOf(kind_)};
  if (kind_ == Kind::kNeoHookean) {
    options.max_estimate_mm = Diagonal(bar_.mesh);  // accepts any estimate: frames are timed
  } else {
    // The bound counts everything at its worst, so that answers are nearer than a millionth.
    options.tolerance_mm = 1e-6 * Diagonal(bar_.mesh);
  }
  options.admission = [this](int64_t bytes) {
    announced_bytes_ = bytes;
    return absl::OkStatus();
  };
  TF_ASSIGN_OR_RETURN(response_, CreateResponse(preparation_, skin_, options));
  return absl::OkStatus();
}

absl::StatusOr<Positions> FrameBenchmark::DirectAnswer() {
  DeformerOptions options;
  options.model = ModelOf(kind_);
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                      CreateDeformer(preparation_, options));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform(poses_));
  return std::move(deformation.positions);
}

absl::Status FrameBenchmark::CheckAnswers() {
  if (!response_->Covers(poses_))
    return absl::InternalError("the prepared answers do not cover 30 degrees");
  TF_ASSIGN_OR_RETURN(const Positions direct, DirectAnswer());
  const double allowed =
      kind_ == Kind::kNeoHookean ? response_->ErrorBoundMm(poses_) : 1e-6 * Diagonal(bar_.mesh);
  for (const InstructionSet set : sets_) {
    const ScopedInstructionSet active(set);
    response_->Evaluate(poses_, &frame_);
    const double off =
        (frame_.cast<double>() - direct(skin_, Eigen::all)).rowwise().norm().maxCoeff();
    if (off > allowed) {
      return absl::InternalError(absl::StrCat("a prepared answer on ", InstructionSetName(set),
                                              " is off by ", off, " mm"));
    }
  }
  const Positions displacements =
      (direct - bar_.mesh.positions())(preparation_->constraints().constrained(), Eigen::all);
  values_ = IsElastic() ? Interleaved(displacements) : Eigen::MatrixXd(displacements);
  // Of the right size; what is in it does not matter for the time.
  rhs_ = IsElastic() ? Eigen::MatrixXd() : Eigen::MatrixXd(direct);
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> FrameBenchmark::BackSubstitute() {
  if (IsElastic()) {
    TF_ASSIGN_OR_RETURN(ElasticSystem* const system, preparation_->Elastic());
    return system->Solve(rhs_, values_);
  }
  TF_ASSIGN_OR_RETURN(PreparedLaplacian* const laplacian, preparation_->Laplacian());
  return laplacian->system->Solve(rhs_, values_);
}

absl::StatusOr<PartSeconds> FrameBenchmark::AnswerFrame(InstructionSet set) {
  const ScopedInstructionSet active(set);
  // As in a drag no pose comes twice.
  poses_.front().translation_mm.x() = 1 + 1e-3 * (++frames_ % 1000);
  const Stopwatch stopwatch;
  const std::optional<double> bound_mm = response_->Answer(poses_, &frame_);
  if (!bound_mm.has_value() || !std::isfinite(*bound_mm)) {
    return absl::InternalError("a pose of the benchmark is not covered");
  }
  return PartSeconds{{"frame", stopwatch.Seconds()}};
}

absl::StatusOr<PartSeconds> FrameBenchmark::EncodeFrame() {
  const Stopwatch stopwatch;
  const CodedDisplacements coded = EncodeDisplacements(
      (frame_.cast<double>() - bar_.mesh.positions()(skin_, Eigen::all)).cast<float>());
  encoded_bytes_ = coded.bytes.size();
  return PartSeconds{{"encoding", stopwatch.Seconds()}};
}

void FrameBenchmark::AddWork() {
  for (const InstructionSet set : sets_) {
    work_.push_back({WorkOnSet(Name("frame"), set, sets_), kFramesPerRepetition,
                     [this, set] { return AnswerFrame(set); }});
  }
  work_.push_back({Name("solve"), 3, [this]() -> absl::StatusOr<PartSeconds> {
                     const Stopwatch stopwatch;
                     TF_RETURN_IF_ERROR(BackSubstitute().status());
                     return PartSeconds{{"solve", stopwatch.Seconds()}};
                   }});
  if (kind_ == Kind::kElastic) {
    work_.push_back(
        {Name("int16 encoding"), kFramesPerRepetition, [this] { return EncodeFrame(); }});
    return;
  }
  work_.push_back({Name("preparation"), 1, [this]() -> absl::StatusOr<PartSeconds> {
                     const Stopwatch stopwatch;
                     TF_RETURN_IF_ERROR(MakeResponse());
                     return PartSeconds{{"preparation", stopwatch.Seconds()}};
                   }});
}

std::string FrameBenchmark::Name(const std::string& what) const {
  switch (kind_) {
    case Kind::kBasis:
      return absl::StrCat("basis ", what);
    case Kind::kBasisThreeHandles:
      return absl::StrCat("basis ", what, ", 3 handles");
    case Kind::kElastic:
      return absl::StrCat("elastic ", what);
    case Kind::kElasticContact:
      return absl::StrCat("elastic ", what, ", contact");
    case Kind::kNeoHookean:
      break;
  }
  return absl::StrCat("neo-Hookean ", what);
}

BenchmarkRow FrameBenchmark::FrameRow(const PartSeconds& medians, InstructionSet set) const {
  BenchmarkRow frame;
  frame.work = WorkOnSet(Name("frame"), set, sets_);
  frame.ours_seconds = medians.at(absl::StrCat(frame.work, "/frame"));
  if (kind_ == Kind::kElasticContact) {
    frame.peer = "without contact";
    frame.peer_seconds = medians.at(absl::StrCat(WorkOnSet("elastic frame", set, sets_), "/frame"));
  } else {
    frame.peer = "back-substitution";
    frame.peer_seconds = medians.at(absl::StrCat(Name("solve"), "/solve"));
  }
  frame.bytes = response_->bytes_held();
  frame.answer_vertices = static_cast<int64_t>(skin_.size());
  return frame;
}

std::vector<BenchmarkRow> FrameBenchmark::Rows(const PartSeconds& medians) const {
  std::vector<BenchmarkRow> rows;
  for (const InstructionSet set : sets_) rows.push_back(FrameRow(medians, set));
  if (kind_ == Kind::kElastic) {
    BenchmarkRow encoding;
    encoding.work = Name("int16 encoding");
    encoding.ours_seconds = medians.at(absl::StrCat(encoding.work, "/encoding"));
    encoding.bytes = static_cast<int64_t>(encoded_bytes_);
    encoding.answer_vertices = rows.front().answer_vertices;
    rows.push_back(encoding);
  } else {
    BenchmarkRow preparation;
    preparation.work = Name("preparation");
    preparation.ours_seconds = medians.at(absl::StrCat(preparation.work, "/preparation"));
    preparation.bytes = announced_bytes_;
    rows.push_back(preparation);
  }
  return rows;
}

}  // namespace tissueform::benchmarks
