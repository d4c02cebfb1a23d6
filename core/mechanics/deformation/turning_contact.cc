// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/turning_contact.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Right-hand sides of one pass over the factor.
constexpr size_t kRowsPerPass = 32;
// Directions of rows that depend on others up to this part of the largest share their force.
constexpr double kDependent = 1e-10;

SparseMatrix ColumnsOf(const SparseMatrix& matrix, const std::vector<int32_t>& columns) {
  SparseMatrix result(matrix.rows(), static_cast<Eigen::Index>(columns.size()));
  for (size_t c = 0; c < columns.size(); ++c) {
    result.startVec(static_cast<Eigen::Index>(c));
    for (SparseMatrix::InnerIterator entry(matrix, columns[c]); entry; ++entry) {
      result.insertBack(entry.row(), static_cast<Eigen::Index>(c)) = entry.value();
    }
  }
  result.finalize();
  return result;
}

}  // namespace

TurningContact::TurningContact(const MeshPreparation& preparation, const ElasticSystem& elastic,
                               const ElasticContact& contact)
    : preparation_(preparation),
      elastic_(elastic),
      rows_(preparation.constraints().contact()),
      unilateral_(contact.rows()),
      sliding_of_vertex_(static_cast<size_t>(preparation.mesh().num_vertices()), -1),
      normals_(rows_.size()),
      resting_gaps_(static_cast<Eigen::Index>(rows_.size())),
      turns_(preparation.constraints().handles().size()) {
  for (const SlidingBasis::TurnedVertex& turned : elastic.sliding().vertices()) {
    sliding_of_vertex_[static_cast<size_t>(turned.vertex)] = static_cast<int32_t>(sliding_.size());
    sliding_.push_back({.unknown = 3 * Eigen::Index{turned.vertex},
                        .rest_axes = turned.axes,
                        .axes = turned.axes});
  }
  for (const SlidingBasis::Held& held : elastic.sliding().held()) {
    const ContactRow& row = rows_[static_cast<size_t>(held.row)];
    SlidingVertex& vertex =
        sliding_[static_cast<size_t>(sliding_of_vertex_[static_cast<size_t>(row.vertex)])];
    vertex.bone = row.handle;
    ++vertex.num_held;
  }
}

absl::StatusOr<std::unique_ptr<TurningContact>> TurningContact::Create(
    const MeshPreparation& preparation, const ElasticSystem& elastic,
    const ElasticContact& contact) {
  auto turning = absl::WrapUnique(new TurningContact(preparation, elastic, contact));
  for (const SlidingBasis::Held& held : elastic.sliding().held()) {
    const ContactRow& row = turning->rows_[static_cast<size_t>(held.row)];
    const int32_t place = turning->sliding_of_vertex_[static_cast<size_t>(row.vertex)];
    if (row.handle == turning->sliding_[static_cast<size_t>(place)].bone) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("contact row ", held.row, " and another bilateral row of vertex ", row.vertex,
                     " are of two bones; leave one of them out"));
  }
  return turning;
}

void TurningContact::SetPoses(absl::Span<const HandlePose> poses) {
  const Positions& rest = preparation_.mesh().positions();
  for (size_t h = 0; h < poses.size(); ++h) turns_[h] = RotationMatrix(poses[h].rotation_vector);
  for (size_t r = 0; r < rows_.size(); ++r) {
    const ContactRow& row = rows_[r];
    double& gap = resting_gaps_[static_cast<Eigen::Index>(r)];
    normals_[r] = row.normal;
    gap = row.gap_mm;
    if (row.handle == ContactRow::kFixedBone) continue;
    const auto handle = static_cast<size_t>(row.handle);
    const Eigen::Vector3d place = rest.row(row.vertex);
    normals_[r] = turns_[handle] * row.normal;
    gap -= normals_[r].dot(ApplyPose(poses[handle], place) - place);
  }
  for (SlidingVertex& vertex : sliding_) {
    if (vertex.bone == ContactRow::kFixedBone) continue;
    vertex.axes = turns_[static_cast<size_t>(vertex.bone)] * vertex.rest_axes;
  }
  MakeDirections();
  const auto num_rows = static_cast<Eigen::Index>(unilateral_.size());
  compliance_ = Eigen::MatrixXd::Zero(num_rows, num_rows);
  has_compliance_.assign(unilateral_.size(), false);
  closed_.clear();
}

void TurningContact::AddLocalDirections(
    int32_t vertex, const Eigen::Vector3d& direction, Eigen::Index row,
    std::vector<Eigen::Triplet<double, int32_t>>* entries) const {
  Eigen::Vector3d local = direction;
  if (const int32_t place = sliding_of_vertex_[static_cast<size_t>(vertex)]; place >= 0) {
    const SlidingVertex& sliding = sliding_[static_cast<size_t>(place)];
    local = sliding.axes.transpose() * direction;
    local.head(sliding.num_held).setZero();
  }
  for (int axis = 0; axis < 3; ++axis) {
    entries->emplace_back(3 * vertex + axis, static_cast<int32_t>(row), local[axis]);
  }
}

void TurningContact::MakeDirections() {
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  for (size_t u = 0; u < unilateral_.size(); ++u) {
    const auto number = static_cast<size_t>(unilateral_[u]);
    const auto column = static_cast<Eigen::Index>(u);
    AddLocalDirections(rows_[number].vertex, normals_[number], column, &entries);
    if (rows_[number].other == ContactRow::kBone) continue;
    AddLocalDirections(rows_[number].other, -normals_[number], column, &entries);
  }
  directions_.resize(3 * preparation_.mesh().num_vertices(),
                     static_cast<Eigen::Index>(unilateral_.size()));
  directions_.setFromTriplets(entries.begin(), entries.end());
}

absl::Status TurningContact::MakeCompliance(const std::vector<int32_t>& rows) {
  std::vector<int32_t> missing;
  for (const int32_t row : rows) {
    if (!has_compliance_[static_cast<size_t>(row)]) missing.push_back(row);
  }
  const Eigen::Index num_values = elastic_.system().num_prescribed();
  for (size_t first = 0; first < missing.size(); first += kRowsPerPass) {
    const size_t end = std::min(missing.size(), first + kRowsPerPass);
    const std::vector<int32_t> pass(missing.begin() + static_cast<std::ptrdiff_t>(first),
                                    missing.begin() + static_cast<std::ptrdiff_t>(end));
    TF_ASSIGN_OR_RETURN(
        const Eigen::MatrixXd responses,
        elastic_.system().Solve(
            Eigen::MatrixXd(ColumnsOf(directions_, pass)),
            Eigen::MatrixXd::Zero(num_values, static_cast<Eigen::Index>(pass.size()))));
    compliance_(Eigen::all, pass) = directions_.transpose() * responses;
    for (const int32_t row : pass) has_compliance_[static_cast<size_t>(row)] = true;
  }
  return absl::OkStatus();
}

absl::Status TurningContact::Close(std::vector<int32_t> rows) {
  closed_ = std::move(rows);
  closed_directions_ = ColumnsOf(directions_, closed_);
  if (closed_.empty()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(MakeCompliance(closed_));
  closed_gram_.setThreshold(kDependent);
  closed_gram_.compute(Eigen::MatrixXd(closed_directions_.transpose() * closed_directions_));
  const Eigen::MatrixXd C = compliance_(closed_, closed_);
  closed_compliance_.setThreshold(kDependent);
  closed_compliance_.compute(0.5 * (C + C.transpose()));
  return absl::OkStatus();
}

double TurningContact::Gap(const ContactRow& row, size_t number,
                           const Positions& displacements) const {
  Eigen::RowVector3d moved = displacements.row(row.vertex);
  if (row.other != ContactRow::kBone) moved -= displacements.row(row.other);
  return moved.dot(normals_[number]) + resting_gaps_[static_cast<Eigen::Index>(number)];
}

Eigen::VectorXd TurningContact::Gaps(const Positions& displacements) const {
  Eigen::VectorXd gaps(static_cast<Eigen::Index>(unilateral_.size()));
  for (size_t u = 0; u < unilateral_.size(); ++u) {
    const auto number = static_cast<size_t>(unilateral_[u]);
    gaps[static_cast<Eigen::Index>(u)] = Gap(rows_[number], number, displacements);
  }
  return gaps;
}

double TurningContact::Miss(const Positions& displacements) const {
  double largest = 0;
  for (size_t r = 0; r < rows_.size(); ++r) {
    if (rows_[r].bilateral) largest = std::max(largest, std::abs(Gap(rows_[r], r, displacements)));
  }
  const Eigen::VectorXd gaps = Gaps(displacements);
  for (const int32_t row : closed_) largest = std::max(largest, std::abs(gaps[row]));
  return largest;
}

absl::StatusOr<Positions> TurningContact::Correction(const Positions& displacements) const {
  Positions correction = Positions::Zero(displacements.rows(), 3);
  Eigen::Map<Eigen::VectorXd> by_unknown(correction.data(), correction.size());
  const Eigen::MatrixXd at_rest = Eigen::MatrixXd::Zero(elastic_.system().num_prescribed(), 1);
  const std::vector<SlidingBasis::Held>& held = elastic_.sliding().held();
  if (!held.empty()) {
    Eigen::MatrixXd along_normals(static_cast<Eigen::Index>(held.size()), 1);
    for (size_t h = 0; h < held.size(); ++h) {
      const auto number = static_cast<size_t>(held[h].row);
      along_normals(static_cast<Eigen::Index>(h), 0) = -Gap(rows_[number], number, displacements);
    }
    TF_ASSIGN_OR_RETURN(by_unknown, elastic_.Solve({}, at_rest, along_normals));
    // The axes of the linear system have not turned.
    for (const SlidingVertex& vertex : sliding_) {
      if (vertex.bone == ContactRow::kFixedBone) continue;
      by_unknown.segment<3>(vertex.unknown) =
          (turns_[static_cast<size_t>(vertex.bone)] * by_unknown.segment<3>(vertex.unknown)).eval();
    }
  }
  if (!closed_.empty()) {
    const Eigen::VectorXd gaps = Gaps(displacements + correction)(closed_);
    TF_ASSIGN_OR_RETURN(Eigen::MatrixXd pushed,
                        elastic_.system().Solve(closed_directions_ * HoldClosed(-gaps), at_rest));
    Eigen::VectorXd local = pushed.col(0);
    FromLocal(&local);
    by_unknown += local;
  }
  return correction;
}

void TurningContact::ToLocal(Eigen::VectorXd* x) const {
  for (const SlidingVertex& vertex : sliding_) {
    x->segment<3>(vertex.unknown) =
        (vertex.axes.transpose() * x->segment<3>(vertex.unknown)).eval();
  }
}

void TurningContact::FromLocal(Eigen::VectorXd* x) const {
  for (const SlidingVertex& vertex : sliding_) {
    x->segment<3>(vertex.unknown) = (vertex.axes * x->segment<3>(vertex.unknown)).eval();
  }
}

void TurningContact::Project(Eigen::VectorXd* local) const {
  for (const SlidingVertex& vertex : sliding_) {
    local->segment(vertex.unknown, vertex.num_held).setZero();
  }
  if (closed_.empty()) return;
  const Eigen::VectorXd along = closed_directions_.transpose() * *local;
  *local -= closed_directions_ * closed_gram_.solve(along);
}

Eigen::VectorXd TurningContact::Forces(const Eigen::VectorXd& local_gradient) const {
  Eigen::VectorXd forces = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(unilateral_.size()));
  if (closed_.empty()) return forces;
  const Eigen::VectorXd along = closed_directions_.transpose() * local_gradient;
  const Eigen::VectorXd of_closed = closed_gram_.solve(along);
  forces(closed_) = of_closed;
  return forces;
}

absl::StatusOr<Eigen::VectorXd> TurningContact::Respond(const Eigen::VectorXd& forces,
                                                        const Solve& solve) const {
  TF_ASSIGN_OR_RETURN(Eigen::VectorXd response, solve(forces));
  if (!closed_.empty()) {
    const Eigen::VectorXd moved = closed_directions_.transpose() * response;
    TF_ASSIGN_OR_RETURN(response, solve(forces - closed_directions_ * HoldClosed(moved)));
  }
  // Rounding of the solver must not open rows.
  Project(&response);
  return response;
}

int64_t TurningContact::BytesNeeded(const ConstraintSet& constraints) {
  // The compliance of the unilateral rows and two factors of the closed ones.
  const auto lifts_off = [](const ContactRow& row) { return !row.bilateral; };
  const int64_t rows = std::ranges::count_if(constraints.contact(), lifts_off);
  return 3 * rows * rows * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
