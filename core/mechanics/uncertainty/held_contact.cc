// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/held_contact.h"

#include <algorithm>
#include <vector>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// So many right-hand sides are solved at once: they are dense, 3 #V numbers each.
constexpr Eigen::Index kRowsAtOnce = 32;

// Normals on a handle's bone are turned by its pose where they turn.
Eigen::Vector3d NormalAt(const ContactRow& row, absl::Span<const HandlePose> poses,
                         bool normals_turn) {
  if (!normals_turn || row.handle == ContactRow::kFixedBone) return row.normal;
  return RotationMatrix(poses[static_cast<size_t>(row.handle)].rotation_vector) * row.normal;
}

double GapAt(const ContactRow& row, const Eigen::Vector3d& normal, const Positions& rest,
             absl::Span<const HandlePose> poses, const Positions& deformed) {
  const Eigen::Vector3d place = rest.row(row.vertex);
  Eigen::Vector3d moved = deformed.row(row.vertex) - rest.row(row.vertex);
  if (row.other != ContactRow::kBone) {
    moved -= (deformed.row(row.other) - rest.row(row.other)).transpose();
  } else if (row.handle != ContactRow::kFixedBone) {
    moved -= ApplyPose(poses[static_cast<size_t>(row.handle)], place) - place;
  }
  return normal.dot(moved) + row.gap_mm;
}

}  // namespace

std::vector<int32_t> HeldRows(const ConstraintSet& constraints, const Positions& rest,
                              absl::Span<const HandlePose> poses, const Positions& deformed,
                              bool normals_turn) {
  std::vector<int32_t> held;
  for (size_t r = 0; r < constraints.contact().size(); ++r) {
    const ContactRow& row = constraints.contact()[r];
    const Eigen::Vector3d normal = NormalAt(row, poses, normals_turn);
    if (!row.bilateral && GapAt(row, normal, rest, poses, deformed) > kClosedGapMm) continue;
    held.push_back(static_cast<int32_t>(r));
  }
  return held;
}

SparseMatrix HeldDirections(const ConstraintSet& constraints, const Positions& rest,
                            absl::Span<const HandlePose> poses, const Positions& deformed,
                            bool normals_turn) {
  const std::vector<int32_t> held = HeldRows(constraints, rest, poses, deformed, normals_turn);
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  for (size_t h = 0; h < held.size(); ++h) {
    const ContactRow& row = constraints.contact()[static_cast<size_t>(held[h])];
    const Eigen::Vector3d normal = NormalAt(row, poses, normals_turn);
    for (int axis = 0; axis < 3; ++axis) {
      const auto column = static_cast<int32_t>(h);
      entries.emplace_back(3 * row.vertex + axis, column, normal[axis]);
      if (row.other == ContactRow::kBone) continue;
      entries.emplace_back(3 * row.other + axis, column, -normal[axis]);
    }
  }
  SparseMatrix directions(3 * rest.rows(), static_cast<Eigen::Index>(held.size()));
  directions.setFromTriplets(entries.begin(), entries.end());
  return directions;
}

absl::StatusOr<HeldResponse> HeldResponse::Create(const DirichletSystem& system,
                                                  const SparseMatrix& directions,
                                                  const Cancellation& cancellation) {
  HeldResponse response(system, directions);
  const SparseMatrix& N = response.directions_;
  if (N.cols() == 0) return response;
  Eigen::MatrixXd S(N.cols(), N.cols());
  for (Eigen::Index first = 0; first < N.cols(); first += kRowsAtOnce) {
    TF_RETURN_IF_ERROR(cancellation.Check());
    const Eigen::Index rows = std::min(kRowsAtOnce, N.cols() - first);
    const Eigen::MatrixXd forces = Eigen::MatrixXd(N.middleCols(first, rows));
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd answers, response.SolveFree(forces));
    S.middleCols(first, rows) = N.transpose() * answers;
  }
  response.compliance_.compute(S);
  return response;
}

absl::StatusOr<Eigen::MatrixXd> HeldResponse::SolveFree(const Eigen::MatrixXd& forces) const {
  return system_->Solve(forces, Eigen::MatrixXd::Zero(system_->num_prescribed(), forces.cols()));
}

absl::StatusOr<Eigen::MatrixXd> HeldResponse::Respond(const Eigen::MatrixXd& forces) const {
  TF_ASSIGN_OR_RETURN(Eigen::MatrixXd answer, SolveFree(forces));
  if (directions_.cols() == 0) return answer;
  const Eigen::MatrixXd borne = compliance_.solve(directions_.transpose() * answer);
  return SolveFree(forces - directions_ * borne);
}

}  // namespace tissueform
