// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/mesh_preparation.h"

#include <utility>

#include "absl/memory/memory.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/validation.h"

namespace tissueform {
namespace {

int64_t BytesOf(const Eigen::MatrixXd& matrix) {
  return matrix.size() * static_cast<int64_t>(sizeof(double));
}

}  // namespace

absl::StatusOr<std::unique_ptr<PreparedLaplacian>> PrepareLaplacian(
    const SparseMatrix& L, const ConstraintSet& constraints,
    const DirichletSystem::Options& options, const Cancellation& cancellation) {
  auto laplacian = std::make_unique<PreparedLaplacian>();
  laplacian->negative_weights = CountNegativeWeights(L);
  TF_ASSIGN_OR_RETURN(laplacian->system,
                      DirichletSystem::Create(L, constraints.constrained(), options, cancellation));
  ReportProgress(options.observer, PreparationStage::kResponses);
  const Stopwatch stopwatch;
  const std::vector<int32_t> guided = GuidedVertices(constraints);
  if (guided.size() == constraints.constrained().size()) {
    TF_ASSIGN_OR_RETURN(laplacian->harmonic,
                        ComputeHarmonicFields(constraints, laplacian->system.get()));
  } else {
    DirichletSystem::Options for_fields = options;
    for_fields.node_order = laplacian->system->node_order();
    for_fields.observer = nullptr;
    TF_ASSIGN_OR_RETURN(const auto system,
                        DirichletSystem::Create(L, guided, for_fields, cancellation));
    TF_ASSIGN_OR_RETURN(laplacian->harmonic, ComputeHarmonicFields(constraints, system.get()));
  }
  TF_ASSIGN_OR_RETURN(
      laplacian->contact,
      LaplacianContact::Create(constraints, *laplacian->system, options.admission, cancellation));
  laplacian->harmonic_seconds = stopwatch.Seconds();
  return laplacian;
}

int64_t PreparedLaplacian::bytes_held() const {
  return system->bytes_held() + BytesOf(harmonic) + contact->bytes_held();
}

namespace {

absl::Status CheckContactIsOfTets(const TetMesh& mesh, const ConstraintSet& constraints) {
  if (constraints.contact().empty()) return absl::OkStatus();
  std::vector<bool> in_tet(static_cast<size_t>(mesh.num_vertices()), false);
  for (const int32_t vertex : mesh.tets().reshaped()) in_tet[static_cast<size_t>(vertex)] = true;
  for (size_t row = 0; row < constraints.contact().size(); ++row) {
    const ContactRow& of_row = constraints.contact()[row];
    for (const int32_t vertex : {of_row.vertex, of_row.other}) {
      if (vertex == ContactRow::kBone || in_tet[static_cast<size_t>(vertex)]) continue;
      return absl::InvalidArgumentError(absl::StrCat("contact row ", row, " names vertex ", vertex,
                                                     ", which no tet holds; remove the row"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::shared_ptr<MeshPreparation>> MeshPreparation::Create(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    PreparationOptions options) {
  TF_RETURN_IF_ERROR(CheckPoissonRatio(options.poisson_ratio));
  if (!options.mesh_is_usable) {
    TF_RETURN_IF_ERROR(CheckTetMesh(mesh));
  }
  TF_RETURN_IF_ERROR(CheckStiffness(mesh.num_tets(), stiffness, "tet"));
  TF_RETURN_IF_ERROR(CheckEveryComponentConstrained(mesh.tets(), mesh.num_vertices(), constraints));
  TF_RETURN_IF_ERROR(CheckContactIsOfTets(mesh, constraints));
  return absl::WrapUnique(new MeshPreparation(mesh, stiffness, constraints, std::move(options)));
}

MeshPreparation::MeshPreparation(const TetMesh& mesh, Eigen::VectorXd stiffness,
                                 ConstraintSet constraints, PreparationOptions options)
    : mesh_(mesh),
      stiffness_(std::move(stiffness)),
      constraints_(std::move(constraints)),
      options_(std::move(options)),
      elements_(ElementsOf(mesh)),
      vertex_cells_(elements_.cells, elements_.num_vertices()),
      node_order_(options_.node_order) {}

absl::StatusOr<PreparedLaplacian*> MeshPreparation::Laplacian(const Cancellation& cancellation) {
  if (laplacian_ == nullptr) {
    ReportProgress(options_.observer, PreparationStage::kAssembling);
    const Stopwatch stopwatch;
    const SparseMatrix L = CotangentLaplacian(mesh_, stiffness_, options_.threads);
    const double assemble_seconds = stopwatch.Seconds();
    TF_ASSIGN_OR_RETURN(laplacian_, PrepareLaplacian(L, constraints_,
                                                     {.backend = options_.backend,
                                                      .admission = options_.admission,
                                                      .node_order = node_order_,
                                                      .observer = options_.observer},
                                                     cancellation));
    laplacian_->assemble_seconds = assemble_seconds;
    node_order_ = laplacian_->system->node_order();
  }
  return laplacian_.get();
}

absl::StatusOr<ElasticSystem*> MeshPreparation::Elastic(const Cancellation& cancellation) {
  if (elastic_ == nullptr) {
    TF_ASSIGN_OR_RETURN(elastic_, ElasticSystem::Create(mesh_, stiffness_, constraints_,
                                                        {.poisson_ratio = options_.poisson_ratio,
                                                         .backend = options_.backend,
                                                         .admission = options_.admission,
                                                         .threads = options_.threads,
                                                         .node_order = node_order_,
                                                         .observer = options_.observer},
                                                        cancellation));
    node_order_ = elastic_->system().node_order();
  }
  return elastic_.get();
}

absl::StatusOr<const ElasticContact*> MeshPreparation::Contact(const Cancellation& cancellation) {
  if (contact_ == nullptr) {
    TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, Elastic(cancellation));
    TF_ASSIGN_OR_RETURN(contact_, ElasticContact::Create(mesh_, constraints_, *elastic,
                                                         options_.admission, cancellation));
  }
  return contact_.get();
}

int64_t MeshPreparation::bytes_held() const {
  return laplacian_bytes() + (elastic_ != nullptr ? elastic_->bytes_held() : 0) +
         (contact_ != nullptr ? contact_->bytes_held() : 0);
}

int64_t MeshPreparation::laplacian_bytes() const {
  return vertex_cells_.bytes_held() + BytesOf(stiffness_) + BytesOf(elements_.measures) +
         static_cast<int64_t>(node_order_.size() * sizeof(int32_t)) +
         (laplacian_ != nullptr ? laplacian_->bytes_held() : 0);
}

}  // namespace tissueform
