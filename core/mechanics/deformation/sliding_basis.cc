// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/sliding_basis.h"

#include <cstddef>
#include <map>
#include <utility>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

// Three orthonormal axes of which the first are the normals, orthogonal within 1e-6.
Eigen::Matrix3d AxesFrom(const std::vector<Eigen::Vector3d>& normals) {
  Eigen::Matrix3d axes;
  axes.col(0) = normals[0].normalized();
  const Eigen::Vector3d second = normals.size() > 1 ? normals[1] : axes.col(0).unitOrthogonal();
  axes.col(1) = (second - second.dot(axes.col(0)) * axes.col(0)).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  if (normals.size() > 2 && normals[2].dot(axes.col(2)) < 0) axes.col(2) = -axes.col(2);
  return axes;
}

}  // namespace

SlidingBasis::SlidingBasis(const ConstraintSet& constraints, Eigen::Index num_vertices)
    : num_unknowns_(3 * num_vertices) {
  std::map<int32_t, std::vector<int32_t>> rows_of_vertex;
  const std::vector<ContactRow>& rows = constraints.contact();
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].bilateral) rows_of_vertex[rows[row].vertex].push_back(static_cast<int32_t>(row));
  }
  for (const auto& [vertex, of_vertex] : rows_of_vertex) {
    std::vector<Eigen::Vector3d> normals;
    for (const int32_t row : of_vertex) {
      held_.push_back({.unknown = 3 * vertex + static_cast<int32_t>(normals.size()), .row = row});
      normals.push_back(rows[static_cast<size_t>(row)].normal);
    }
    vertices_.push_back({.vertex = vertex, .axes = AxesFrom(normals)});
  }
}

SparseMatrix SlidingBasis::Turn(const SparseMatrix& K) const {
  SparseMatrix Q(num_unknowns_, num_unknowns_);
  Q.reserve(num_unknowns_ + 6 * static_cast<Eigen::Index>(vertices_.size()));
  auto turned = vertices_.begin();
  for (Eigen::Index vertex = 0; vertex < num_unknowns_ / 3; ++vertex) {
    const bool is_turned = turned != vertices_.end() && turned->vertex == vertex;
    for (int axis = 0; axis < 3; ++axis) {
      Q.startVec(3 * vertex + axis);
      if (!is_turned) Q.insertBack(3 * vertex + axis, 3 * vertex + axis) = 1;
      for (int i = 0; is_turned && i < 3; ++i) {
        Q.insertBack(3 * vertex + i, 3 * vertex + axis) = turned->axes(i, axis);
      }
    }
    if (is_turned) ++turned;
  }
  Q.finalize();
  const SparseMatrix half = K * Q;
  return Q.transpose() * half;
}

void SlidingBasis::ToTurned(Eigen::MatrixXd* x) const {
  for (const TurnedVertex& turned : vertices_) {
    x->middleRows<3>(3 * Eigen::Index{turned.vertex}) =
        (turned.axes.transpose() * x->middleRows<3>(3 * Eigen::Index{turned.vertex})).eval();
  }
}

void SlidingBasis::FromTurned(Eigen::MatrixXd* x) const {
  for (const TurnedVertex& turned : vertices_) {
    x->middleRows<3>(3 * Eigen::Index{turned.vertex}) =
        (turned.axes * x->middleRows<3>(3 * Eigen::Index{turned.vertex})).eval();
  }
}

HeldMatrix HoldUnknowns(const SparseMatrix& K, const std::vector<SlidingBasis::Held>& held) {
  const auto num_held = static_cast<Eigen::Index>(held.size());
  std::vector<bool> is_held(static_cast<size_t>(K.rows()), false);
  HeldMatrix result;
  result.columns.resize(K.rows(), num_held);
  result.diagonal.resize(num_held);
  for (Eigen::Index h = 0; h < num_held; ++h) {
    const int32_t unknown = held[static_cast<size_t>(h)].unknown;
    is_held[static_cast<size_t>(unknown)] = true;
    result.columns.startVec(h);
    for (SparseMatrix::InnerIterator entry(K, unknown); entry; ++entry) {
      result.columns.insertBack(entry.row(), h) = entry.value();
    }
    result.diagonal[h] = K.coeff(unknown, unknown);
  }
  result.columns.finalize();
  result.matrix = K;
  for (Eigen::Index column = 0; column < K.cols(); ++column) {
    for (SparseMatrix::InnerIterator entry(result.matrix, column); entry; ++entry) {
      const bool taken_out = is_held[static_cast<size_t>(column)] || is_held[entry.row()];
      if (taken_out && entry.row() != column) entry.valueRef() = 0;
    }
  }
  return result;
}

void PrescribeHeld(const HeldMatrix& held_matrix, const std::vector<SlidingBasis::Held>& held,
                   const Eigen::MatrixXd& values, Eigen::MatrixXd* rhs) {
  *rhs -= held_matrix.columns * values;
  for (size_t h = 0; h < held.size(); ++h) {
    const auto row = static_cast<Eigen::Index>(h);
    rhs->row(held[h].unknown) = held_matrix.diagonal[row] * values.row(row);
  }
}

}  // namespace tissueform
