// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/term_responses.h"

#include <vector>

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/harmonic_fields.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kCellGrain = 4096;
constexpr Eigen::Index kVertexGrain = 1024;

// B_n at the barycentres, #C by count.
CellField EvaluateAtCells(const SimplexDomain& domain, const SimplexPolynomials& polynomials,
                          Eigen::Index first, Eigen::Index count, const Eigen::MatrixXd& harmonic,
                          const MeshPreparation& preparation) {
  const PiecewiseLinearElements& elements = preparation.elements();
  CellField values(elements.num_cells(), count);
  ParallelFor(preparation.options().threads, elements.num_cells(), kCellGrain,
              [&](Eigen::Index begin, Eigen::Index end) {
                std::vector<double> workspace;
                Eigen::VectorXd u(harmonic.cols());
                Eigen::VectorXd y(harmonic.cols());
                for (Eigen::Index c = begin; c < end; ++c) {
                  for (Eigen::Index h = 0; h < u.size(); ++h) {
                    u[h] = MeanOverCorners(elements.cells, harmonic.col(h), c);
                  }
                  y = domain.ToUnit(u);
                  polynomials.Evaluate(
                      y, first, absl::MakeSpan(values.row(c).data(), static_cast<size_t>(count)),
                      &workspace);
                }
              });
  return values;
}

// Stiffness times the integral of the gradient of a corner's hat function.
Eigen::Vector3d CornerPull(const MeshPreparation& preparation, Eigen::Index cell, int corner) {
  const Eigen::Matrix3d integrals = HatGradientIntegrals<4>(preparation.elements(), cell);
  const double stiffness = preparation.stiffness()[cell];
  return corner == 0 ? Eigen::Vector3d(-stiffness * integrals.rowwise().sum())
                     : Eigen::Vector3d(stiffness * integrals.col(corner - 1));
}

// G^T M' diag(B_n) grad v, #V by 3 * count. Gathered vertex by vertex, so the result does not
// depend on the number of threads.
Eigen::MatrixXd GatherTermLoads(const CellField& values, const MeshPreparation& preparation) {
  const VertexCells& vertex_cells = preparation.vertex_cells();
  const Eigen::Index num_vertices = preparation.mesh().num_vertices();
  Eigen::MatrixXd loads(num_vertices, 3 * values.cols());
  ParallelFor(preparation.options().threads, num_vertices, kVertexGrain,
              [&](Eigen::Index begin, Eigen::Index end) {
                Eigen::Matrix3Xd sum(3, values.cols());
                for (Eigen::Index v = begin; v < end; ++v) {
                  sum.setZero();
                  for (Eigen::Index k = vertex_cells.begin(v); k < vertex_cells.end(v); ++k) {
                    const int32_t cell = vertex_cells.cell(k);
                    const Eigen::Vector3d pull =
                        CornerPull(preparation, cell, vertex_cells.corner(k));
                    for (Eigen::Index n = 0; n < values.cols(); ++n) {
                      sum.col(n) += values(cell, n) * pull;
                    }
                  }
                  loads.row(v) = sum.reshaped().transpose();
                }
              });
  return loads;
}

}  // namespace

absl::StatusOr<Eigen::MatrixXd> TermResponses(const SimplexDomain& domain,
                                              const SimplexPolynomials& polynomials,
                                              Eigen::Index first, Eigen::Index count,
                                              MeshPreparation* preparation) {
  TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian());
  const Eigen::MatrixXd loads = GatherTermLoads(
      EvaluateAtCells(domain, polynomials, first, count, laplacian->harmonic, *preparation),
      *preparation);
  const auto num_constrained =
      static_cast<Eigen::Index>(preparation->constraints().constrained().size());
  return laplacian->system->Solve(loads, Eigen::MatrixXd::Zero(num_constrained, loads.cols()));
}

absl::StatusOr<Eigen::MatrixXd> HandleResponse(int handle, const Eigen::Vector3d& origin,
                                               MeshPreparation* preparation) {
  TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian());
  const ConstraintSet& constraints = preparation->constraints();
  const std::vector<int32_t>& vertices = constraints.constrained();
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(vertices.size()), 3);
  for (size_t c = 0; c < vertices.size(); ++c) {
    if (constraints.region_of_constrained()[c] == handle) {
      values.row(static_cast<Eigen::Index>(c)) =
          preparation->mesh().positions().row(vertices[c]) - origin.transpose();
    }
  }
  return laplacian->system->Solve(Eigen::MatrixXd(), values);
}

}  // namespace tissueform
