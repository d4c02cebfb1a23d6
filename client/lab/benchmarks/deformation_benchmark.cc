// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/deformation_benchmark.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "absl/memory/memory.h"
#include "absl/status/status.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/deformation/poisson_reconstruction.h"
#include "core/mechanics/deformation/rotation_estimation.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/operators/laplacian.h"

namespace tissueform::benchmarks {
namespace {

constexpr int kIterationsPerRepetition = 5;

absl::StatusOr<std::string> MakeTemporaryFolder() {
  std::string folder = (std::filesystem::temp_directory_path() / "tissueform-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, "cannot create a temporary folder for a mesh file");
  }
  return folder;
}

int64_t BytesOf(const TetMesh& mesh) {
  return mesh.positions().size() * static_cast<int64_t>(sizeof(double)) +
         mesh.tets().size() * static_cast<int64_t>(sizeof(int32_t));
}

int64_t BytesOf(const SparseMatrix& matrix) {
  return matrix.nonZeros() * static_cast<int64_t>(sizeof(double) + sizeof(int32_t)) +
         (matrix.outerSize() + 1) * static_cast<int64_t>(sizeof(int32_t));
}

}  // namespace

DeformationBenchmark::DeformationBenchmark(const TestBar& bar, const LinearSolverBenchmark& solvers,
                                           int threads)
    : bar_(bar),
      solvers_(solvers),
      threads_(threads),
      elements_(ElementsOf(bar.mesh)),
      vertex_cells_(bar.mesh.tets(), bar.mesh.num_vertices()) {
  work_.push_back({"read", 1, [this] { return Read(); }});
  work_.push_back({"assemble", 1, [this] { return Assemble(); }});
  work_.push_back({"iteration", kIterationsPerRepetition, [this] { return Iterate(); }});
  work_.push_back({"answer", 1, [this] { return Answer(); }});
}

DeformationBenchmark::~DeformationBenchmark() {
  if (!folder_.empty()) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
}

absl::StatusOr<std::unique_ptr<DeformationBenchmark>> DeformationBenchmark::Create(
    const TestBar& bar, const LinearSolverBenchmark& solvers, int threads) {
  auto benchmark = absl::WrapUnique(new DeformationBenchmark(bar, solvers, threads));
  TF_RETURN_IF_ERROR(benchmark->WriteFile());
  TF_RETURN_IF_ERROR(benchmark->PrepareIteration());
  for (const TimedWork& work : benchmark->work_) {
    TF_RETURN_IF_ERROR(work.run().status());
  }
  return benchmark;
}

absl::Status DeformationBenchmark::WriteFile() {
  TF_ASSIGN_OR_RETURN(folder_, MakeTemporaryFolder());
  file_ = folder_ + "/bar.vtu";
  return WriteTetMesh(file_, {bar_.mesh, {}, {}, 0});
}

absl::Status DeformationBenchmark::PrepareIteration() {
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.tolerance_mm = SidewaysTolerance(bar_);
  options.threads = threads_;
  TF_ASSIGN_OR_RETURN(deformer_,
                      CreateGradientFieldDeformer(bar_.mesh, bar_.stiffness, bar_.ends, options));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer_->Deform(SidewaysPose(bar_)));
  deformed_ = std::move(deformation.positions);

  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd fields,
                      ComputeHarmonicFields(bar_.ends, &solvers_.system()));
  blend_weights_ = BlendWeights(SampleAtBarycentres(elements_.cells, fields), options.blend);
  end_displacements_ = (deformed_ - elements_.rest)(bar_.ends.constrained(), Eigen::all);
  return absl::OkStatus();
}

absl::StatusOr<PartSeconds> DeformationBenchmark::Read() {
  const Stopwatch stopwatch;
  TF_RETURN_IF_ERROR(ReadTetMesh(file_).status());
  return PartSeconds{{"read", stopwatch.Seconds()}};
}

absl::StatusOr<PartSeconds> DeformationBenchmark::Assemble() {
  const Stopwatch stopwatch;
  const PiecewiseLinearElements elements = ElementsOf(bar_.mesh);
  const VertexCells vertex_cells(elements.cells, elements.num_vertices());
  const SparseMatrix L = CotangentLaplacian(bar_.mesh, bar_.stiffness, threads_);
  const double seconds = stopwatch.Seconds();
  matrix_bytes_ = BytesOf(L);
  return PartSeconds{{"assemble", seconds}};
}

absl::StatusOr<PartSeconds> DeformationBenchmark::Iterate() {
  Stopwatch stopwatch;
  EstimateRotations(elements_, deformed_, blend_weights_, CellTransforms(), threads_, &transforms_);
  TransformsToCornerLoads(elements_, bar_.stiffness, threads_, &transforms_);
  const Eigen::MatrixXd rhs =
      GatherCornerLoads(vertex_cells_, elements_.num_vertices(), transforms_, threads_);
  const double local_seconds = stopwatch.Restart();
  TF_RETURN_IF_ERROR(solvers_.system().Solve(rhs, end_displacements_).status());
  return PartSeconds{{"local", local_seconds}, {"whole", local_seconds + stopwatch.Seconds()}};
}

absl::StatusOr<PartSeconds> DeformationBenchmark::Answer() {
  const std::vector<HandlePose> pose = SidewaysPose(bar_);
  const Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(const Deformation deformation, deformer_->Deform(pose));
  const double seconds = stopwatch.Seconds();
  if (!deformation.summary.converged) {
    return absl::InternalError("the estimated answer did not converge");
  }
  solves_ = deformation.summary.iterations;
  return PartSeconds{{"answer", seconds}};
}

std::vector<BenchmarkRow> DeformationBenchmark::Rows(const PartSeconds& medians) const {
  const auto row = [&medians](const char* work, const char* median, int64_t bytes) {
    BenchmarkRow result;
    result.work = work;
    result.ours_seconds = medians.at(median);
    result.bytes = bytes;
    return result;
  };
  const int64_t transform_bytes = transforms_.size() * static_cast<int64_t>(sizeof(double));
  std::vector<BenchmarkRow> rows = {
      row("read", "read/read", BytesOf(bar_.mesh)),
      row("assemble", "assemble/assemble", matrix_bytes_),
      row("local step", "iteration/local", transform_bytes),
      row("estimated iteration", "iteration/whole", transform_bytes),
      row("estimated answer", "answer/answer", deformer_->preparation().bytes_held)};
  rows.back().solves = solves_;
  return rows;
}

}  // namespace tissueform::benchmarks
