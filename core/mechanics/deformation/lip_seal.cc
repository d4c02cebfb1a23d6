// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/lip_seal.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Right-hand sides of one pass over the factor.
constexpr Eigen::Index kPairsPerPass = 32;
// Of a compliance: less is that of something held, up to rounding.
constexpr double kNoCompliance = 1e-10;

SparseMatrix DirectionsAt(const LipEdge& edge, int32_t LipEdge::Pair::*vertex,
                          Eigen::Index num_unknowns) {
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  for (size_t p = 0; p < edge.pairs.size(); ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      entries.emplace_back(3 * edge.pairs[p].*vertex + axis, static_cast<int32_t>(p),
                           edge.up[axis]);
    }
  }
  SparseMatrix directions(num_unknowns, static_cast<Eigen::Index>(edge.pairs.size()));
  directions.setFromTriplets(entries.begin(), entries.end());
  return directions;
}

// Two solves differ in their last digits.
Eigen::MatrixXd Symmetric(const Eigen::MatrixXd& matrix) {
  return 0.5 * (matrix + matrix.transpose());
}

}  // namespace

LipSeal::LipSeal(const LipEdge& edge, const ElasticContact& contact)
    : edge_(edge),
      contact_(contact),
      upper_(DirectionsAt(edge, &LipEdge::Pair::upper, contact.directions().rows())),
      lower_(DirectionsAt(edge, &LipEdge::Pair::lower, contact.directions().rows())) {}

absl::StatusOr<std::unique_ptr<LipSeal>> LipSeal::Create(const LipEdge& edge,
                                                         const ElasticContact& contact,
                                                         const Cancellation& cancellation) {
  auto seal = absl::WrapUnique(new LipSeal(edge, contact));
  TF_RETURN_IF_ERROR(seal->Condense(cancellation));
  return seal;
}

absl::Status LipSeal::SolveForPairs(
    const std::function<void(Eigen::Index first, const Eigen::MatrixXd& responses)>& take,
    const Cancellation& cancellation) const {
  for (Eigen::Index first = 0; first < lower_.cols(); first += kPairsPerPass) {
    TF_RETURN_IF_ERROR(cancellation.Check());
    const Eigen::Index count = std::min(kPairsPerPass, lower_.cols() - first);
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd responses,
                        contact_.Respond(lower_.middleCols(first, count)));
    take(first, responses);
  }
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> LipSeal::ForceColumns(const std::vector<int32_t>& vertices,
                                                      const Cancellation& cancellation) const {
  Eigen::MatrixXd columns(3 * static_cast<Eigen::Index>(vertices.size()), lower_.cols());
  TF_RETURN_IF_ERROR(SolveForPairs(
      [&](Eigen::Index first, const Eigen::MatrixXd& responses) {
        for (size_t v = 0; v < vertices.size(); ++v) {
          columns.block(3 * static_cast<Eigen::Index>(v), first, 3, responses.cols()) =
              responses.middleRows(3 * Eigen::Index{vertices[v]}, 3);
        }
      },
      cancellation));
  return columns;
}

Eigen::MatrixXd LipSeal::Stiffness() const {
  return Symmetric(seal_stiffness_.solve(Eigen::MatrixXd::Identity(lower_.cols(), lower_.cols())));
}

absl::Status LipSeal::Condense(const Cancellation& cancellation) {
  const SparseMatrix& rows = contact_.directions();
  Eigen::MatrixXd seal_compliance(lower_.cols(), lower_.cols());
  Eigen::MatrixXd gaps_of_seal(rows.cols(), lower_.cols());
  TF_RETURN_IF_ERROR(SolveForPairs(
      [&](Eigen::Index first, const Eigen::MatrixXd& responses) {
        seal_compliance.middleCols(first, responses.cols()).noalias() =
            lower_.transpose() * responses;
        gaps_of_seal.middleCols(first, responses.cols()).noalias() = rows.transpose() * responses;
      },
      cancellation));
  TF_RETURN_IF_ERROR(CheckPairsMove(seal_compliance));
  seal_stiffness_.compute(Symmetric(seal_compliance));
  if (seal_stiffness_.info() != Eigen::Success) {
    return absl::InvalidArgumentError(
        "contact seal: its pairs cannot be moved one by one; leave every second pair out");
  }
  across_ = seal_stiffness_.solve(gaps_of_seal.transpose()).transpose();
  compliance_ = Symmetric(contact_.compliance() - across_ * gaps_of_seal.transpose());
  return CheckRowsMove();
}

absl::Status LipSeal::CheckPairsMove(const Eigen::MatrixXd& seal_compliance) const {
  const Eigen::VectorXd compliance = seal_compliance.diagonal();
  for (Eigen::Index p = 0; p < compliance.size(); ++p) {
    if (compliance[p] > kNoCompliance * compliance.maxCoeff()) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "contact seal: pair ", p,
        " cannot move: its lower vertex slides on bone along \"up\"; remove the pair"));
  }
  return absl::OkStatus();
}

absl::Status LipSeal::CheckRowsMove() const {
  for (Eigen::Index r = 0; r < compliance_.rows(); ++r) {
    if (compliance_(r, r) > kNoCompliance * contact_.compliance()(r, r)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("contact seal: contact row ", contact_.rows()[static_cast<size_t>(r)],
                     " cannot move once the lips are sealed; remove the pair of its vertex"));
  }
  return absl::OkStatus();
}

absl::StatusOr<Eigen::VectorXd> LipSeal::Displacements(const Eigen::VectorXd& raise,
                                                       const Eigen::VectorXd& forces) const {
  const Eigen::VectorXd held = seal_stiffness_.solve(raise) - across_.transpose() * forces;
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd displacements,
                      contact_.Respond(contact_.directions() * forces + lower_ * held));
  return displacements.col(0);
}

}  // namespace tissueform
