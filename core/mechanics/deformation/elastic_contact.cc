// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/elastic_contact.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// Right-hand sides of one pass over the factor.
constexpr Eigen::Index kRowsPerPass = 32;

void AddDirection(int32_t vertex, const Eigen::Vector3d& normal, Eigen::Index row,
                  std::vector<Eigen::Triplet<double, int32_t>>* entries) {
  for (int axis = 0; axis < 3; ++axis) {
    entries->emplace_back(3 * vertex + axis, static_cast<int32_t>(row), normal[axis]);
  }
}

// Three rows a vertex.
void TakeVertices(const std::vector<int32_t>& vertices, const Eigen::MatrixXd& from,
                  Eigen::Ref<Eigen::MatrixXd> to) {
  for (size_t i = 0; i < vertices.size(); ++i) {
    to.middleRows<3>(3 * static_cast<Eigen::Index>(i)) =
        from.middleRows<3>(3 * Eigen::Index{vertices[i]});
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<ElasticContact>> ElasticContact::Create(
    const TetMesh& mesh, const ConstraintSet& constraints, const ElasticSystem& elastic,
    const FactorAdmission& admission, const Cancellation& cancellation) {
  auto contact = absl::WrapUnique(new ElasticContact(elastic));
  contact->num_constrained_ = static_cast<Eigen::Index>(constraints.constrained().size());
  for (size_t row = 0; row < constraints.contact().size(); ++row) {
    if (!constraints.contact()[row].bilateral) contact->rows_.push_back(static_cast<int32_t>(row));
  }
  if (contact->rows_.empty()) return contact;
  contact->boundary_ = BoundaryVertices(mesh);
  if (admission) {
    const auto num_rows = static_cast<int64_t>(contact->rows_.size());
    const auto boundary_rows = 3 * static_cast<int64_t>(contact->boundary_.size());
    TF_RETURN_IF_ERROR(
        admission(num_rows * (num_rows + elastic.response_columns().cols() + boundary_rows) *
                  static_cast<int64_t>(sizeof(double))));
  }
  contact->TakeRows(mesh, constraints);
  TF_RETURN_IF_ERROR(contact->MakeCompliance(cancellation));
  const Eigen::VectorXd compliance = contact->compliance_.diagonal();
  TF_RETURN_IF_ERROR(
      CheckContactMoves(Eigen::VectorXd::Constant(compliance.size(), compliance.maxCoeff()),
                        compliance, contact->rows_));
  return contact;
}

void ElasticContact::TakeRows(const TetMesh& mesh, const ConstraintSet& constraints) {
  const auto num_rows = static_cast<Eigen::Index>(rows_.size());
  const Eigen::MatrixXd& responses = elastic_.response_columns();
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  Eigen::MatrixXd bone_motions = Eigen::MatrixXd::Zero(num_rows, responses.cols());
  gaps_at_rest_.resize(num_rows);
  for (Eigen::Index r = 0; r < num_rows; ++r) {
    const ContactRow& row =
        constraints.contact()[static_cast<size_t>(rows_[static_cast<size_t>(r)])];
    gaps_at_rest_[r] = row.gap_mm;
    AddDirection(row.vertex, row.normal, r, &entries);
    if (row.other != ContactRow::kBone) {
      AddDirection(row.other, -row.normal, r, &entries);
    } else if (row.handle != ContactRow::kFixedBone) {
      bone_motions.block<1, ElasticSystem::kColumnsPerHandle>(
          r, Eigen::Index{ElasticSystem::kColumnsPerHandle} * row.handle) =
          ElasticSystem::AffineMotionAlong(row.normal, mesh.positions().row(row.vertex),
                                           elastic_.origin());
    }
  }
  directions_.resize(responses.rows(), num_rows);
  directions_.setFromTriplets(entries.begin(), entries.end());
  gap_columns_ = directions_.transpose() * responses - bone_motions;
}

absl::Status ElasticContact::SolveForRows(
    const std::function<void(Eigen::Index first, const Eigen::MatrixXd& responses)>& take,
    const Cancellation& cancellation) const {
  const Eigen::Index num_rows = directions_.cols();
  for (Eigen::Index first = 0; first < num_rows; first += kRowsPerPass) {
    TF_RETURN_IF_ERROR(cancellation.Check());
    const Eigen::Index count = std::min(kRowsPerPass, num_rows - first);
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd responses,
                        Respond(directions_.middleCols(first, count)));
    take(first, responses);
  }
  return absl::OkStatus();
}

absl::Status ElasticContact::MakeCompliance(const Cancellation& cancellation) {
  compliance_.resize(directions_.cols(), directions_.cols());
  boundary_columns_.resize(3 * static_cast<Eigen::Index>(boundary_.size()), directions_.cols());
  TF_RETURN_IF_ERROR(SolveForRows(
      [this](Eigen::Index first, const Eigen::MatrixXd& responses) {
        compliance_.middleCols(first, responses.cols()).noalias() =
            directions_.transpose() * responses;
        TakeVertices(boundary_, responses, boundary_columns_.middleCols(first, responses.cols()));
      },
      cancellation));
  // Two solves differ in their last digits.
  compliance_ = (0.5 * (compliance_ + compliance_.transpose())).eval();
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> ElasticContact::ForceColumns(
    const std::vector<int32_t>& vertices, const Cancellation& cancellation) const {
  std::vector<int32_t> places;  // in boundary_
  for (const int32_t vertex : vertices) {
    const auto place = std::ranges::lower_bound(boundary_, vertex);
    if (place == boundary_.end() || *place != vertex) break;
    places.push_back(static_cast<int32_t>(place - boundary_.begin()));
  }
  Eigen::MatrixXd columns(3 * static_cast<Eigen::Index>(vertices.size()), directions_.cols());
  if (places.size() == vertices.size()) {
    TakeVertices(places, boundary_columns_, columns);
    return columns;
  }
  TF_RETURN_IF_ERROR(SolveForRows(
      [&](Eigen::Index first, const Eigen::MatrixXd& responses) {
        TakeVertices(vertices, responses, columns.middleCols(first, responses.cols()));
      },
      cancellation));
  return columns;
}

absl::StatusOr<Eigen::MatrixXd> ElasticContact::Respond(const Eigen::MatrixXd& forces) const {
  return elastic_.Solve(forces, Eigen::MatrixXd::Zero(3 * num_constrained_, forces.cols()));
}

absl::StatusOr<Eigen::VectorXd> ElasticContact::Displacements(
    std::span<const double> forces) const {
  const Eigen::Map<const Eigen::VectorXd> l(forces.data(),
                                            static_cast<Eigen::Index>(forces.size()));
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd displacements, Respond(directions_ * l));
  return displacements.col(0);
}

int64_t ElasticContact::bytes_held() const {
  return (compliance_.size() + gap_columns_.size() + gaps_at_rest_.size() +
          boundary_columns_.size()) *
         static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
