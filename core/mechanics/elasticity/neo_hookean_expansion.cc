// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_expansion.h"

#include <algorithm>
#include <vector>

#include <Eigen/LU>

#include "core/mechanics/elasticity/material.h"
#include "core/mechanics/elasticity/third_order_batch.h"

namespace tissueform {
namespace {

using Eigen::Matrix3d;

// What the pairs of a tet's displacement gradient share.
struct Gradient {
  Matrix3d H;
  double trace = 0;
};

// The second-order part of P = dW/dF at F = I + H, as a symmetric bilinear form: with t = tr H,
// m = (t^2 - tr H^2) / 2 the sum of the second minors and C = cof H = (H^2 - t H)^T + m I,
//   P_2 = [K m + mu (m - 5/9 t^2 - |H|^2 / 3)] I - 2/3 mu t H - mu C + (K + mu) t (t I - H^T),
// from J - 1 = t + m, J^(-2/3) = 1 - 2/3 (t + m) + 5/9 t^2 and I1 = 3 + 2 t + |H|^2 in the law's P.
Matrix3d SecondOrderStress(const ElasticModuli& moduli, const Gradient& a, const Gradient& b) {
  const double mu = moduli.shear;
  const double K = moduli.bulk;
  const double t2 = a.trace * b.trace;
  const Matrix3d product = 0.5 * (a.H * b.H + b.H * a.H);
  const Matrix3d traced = 0.5 * (a.trace * b.H + b.trace * a.H);  // t H
  const double m = 0.5 * (t2 - product.trace());
  const double norm2 = a.H.cwiseProduct(b.H).sum();
  Matrix3d P = -2.0 / 3.0 * mu * traced - mu * (product - traced).transpose() -
               (K + mu) * traced.transpose();
  P.diagonal().array() += K * m + mu * (m - 5.0 / 9.0 * t2 - norm2 / 3.0) - mu * m + (K + mu) * t2;
  return P;
}

constexpr auto kTetsAtOnce = static_cast<Eigen::Index>(ThirdOrderBatch::kLanes);

// A number of every field, or of every direction, in a lane.
template <typename Vector>
using OfLane = Eigen::Map<Vector, 0, Eigen::InnerStride<9 * kTetsAtOnce>>;

// Writes a tet's gradients into a lane. `fields`: a column for every coordinate of a vertex.
void FillLane(const PiecewiseLinearElements& elements, Eigen::Index tet,
              const Eigen::MatrixXd& fields, const Eigen::Matrix3d& hats, Eigen::Index lane,
              ThirdOrderBatch* batch) {
  const auto num_first = static_cast<Eigen::Index>(batch->num_fields);
  const Eigen::Index num_second = fields.rows() - num_first;
  Eigen::MatrixX3d edges(fields.rows(), 3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto at = [&](int corner) {
      return fields.col(Eigen::Index{3} * elements.cells(tet, corner) + i);
    };
    for (int a = 0; a < 3; ++a) edges.col(a) = at(a + 1) - at(0);
    const Eigen::MatrixX3d gradients = edges.lazyProduct(hats.transpose());
    for (Eigen::Index j = 0; j < 3; ++j) {
      const Eigen::Index to = (3 * i + j) * kTetsAtOnce + lane;
      OfLane<Eigen::VectorXd>(batch->first.data() + to, num_first) =
          gradients.col(j).head(num_first);
      OfLane<Eigen::VectorXd>(batch->second.data() + to, num_second) =
          gradients.col(j).tail(num_second);
    }
  }
}

// Adds what a lane's tet pulls at its corners. `forces`: a column for every coordinate.
void AddLane(const PiecewiseLinearElements& elements, Eigen::Index tet, Eigen::Index lane,
             const ThirdOrderBatch& batch, Eigen::MatrixXd* forces) {
  for (Eigen::Index i = 0; i < 9; ++i) {
    const auto pulls =
        OfLane<const Eigen::VectorXd>(batch.loads.data() + i * kTetsAtOnce + lane, forces->rows());
    forces->col(Eigen::Index{3} * elements.cells(tet, static_cast<int>(1 + i / 3)) + i % 3) +=
        pulls;
    forces->col(Eigen::Index{3} * elements.cells(tet, 0) + i % 3) -= pulls;
  }
}

// A cubic's values at the directions e_a + e_b + e_c from its columns: row d holds m n_a n_b n_c.
Eigen::MatrixXd CubicsAtDirections(Eigen::Index count) {
  std::vector<std::vector<Eigen::Index>> triples;
  for (Eigen::Index a = 0; a < count; ++a) {
    for (Eigen::Index b = a; b < count; ++b) {
      for (Eigen::Index c = b; c < count; ++c) triples.push_back({a, b, c});
    }
  }
  const auto size = static_cast<Eigen::Index>(triples.size());
  Eigen::MatrixXd values(size, size);
  for (Eigen::Index d = 0; d < size; ++d) {
    Eigen::VectorXd n = Eigen::VectorXd::Zero(count);
    for (const Eigen::Index number : triples[static_cast<size_t>(d)]) n[number] += 1;
    values.row(d) = TripleProducts(n).transpose();
  }
  return values;
}

}  // namespace

Eigen::VectorXd TripleProducts(const Eigen::VectorXd& numbers) {
  Eigen::VectorXd products(NumFieldTriples(numbers.size()));
  Eigen::Index triple = 0;
  for (Eigen::Index a = 0; a < numbers.size(); ++a) {
    for (Eigen::Index b = a; b < numbers.size(); ++b) {
      for (Eigen::Index c = b; c < numbers.size(); ++c) {
        const double orders = a == c ? 1 : a == b || b == c ? 3 : 6;
        products[triple++] = orders * numbers[a] * numbers[b] * numbers[c];
      }
    }
  }
  return products;
}

Eigen::MatrixXd SecondOrderForces(const PiecewiseLinearElements& elements,
                                  const Eigen::VectorXd& stiffness, double poisson_ratio,
                                  const Eigen::MatrixXd& fields) {
  const Eigen::Index count = fields.cols();
  const ElasticModuli unit = ModuliOf(1.0, poisson_ratio);
  // Transposed: what a tet adds to a corner's coordinate is one run of memory.
  Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(NumFieldPairs(count), fields.rows());
  std::vector<Gradient> gradients(static_cast<size_t>(count));
  for (Eigen::Index tet = 0; tet < elements.num_cells(); ++tet) {
    const Eigen::Matrix3d hats = HatGradients<4>(elements, tet);
    const Eigen::Vector3d hat0 = -hats.rowwise().sum();
    const auto hat = [&](int corner) -> Eigen::Vector3d {
      return corner == 0 ? hat0 : Eigen::Vector3d(hats.col(corner - 1));
    };
    for (size_t f = 0; f < gradients.size(); ++f) {
      gradients[f].H.setZero();
      for (int corner = 0; corner < 4; ++corner) {
        const Eigen::Index at = Eigen::Index{3} * elements.cells(tet, corner);
        gradients[f].H +=
            fields.col(static_cast<Eigen::Index>(f)).segment<3>(at) * hat(corner).transpose();
      }
      gradients[f].trace = gradients[f].H.trace();
    }
    const double weight = stiffness[tet] * elements.measures[tet];
    Eigen::Index pair = 0;
    for (size_t a = 0; a < gradients.size(); ++a) {
      for (size_t b = a; b < gradients.size(); ++b, ++pair) {
        const Matrix3d P = weight * SecondOrderStress(unit, gradients[a], gradients[b]);
        for (int corner = 0; corner < 4; ++corner) {
          const Eigen::Index at = Eigen::Index{3} * elements.cells(tet, corner);
          forces.row(pair).segment<3>(at) += (P * hat(corner)).transpose();
        }
      }
    }
  }
  return forces.transpose();
}

Eigen::MatrixXd ThirdOrderForces(const PiecewiseLinearElements& elements,
                                 const Eigen::VectorXd& stiffness, double poisson_ratio,
                                 const Eigen::MatrixXd& first, const Eigen::MatrixXd& second) {
  const ElasticModuli unit = ModuliOf(1.0, poisson_ratio);
  Eigen::MatrixXd fields(first.cols() + second.cols(), first.rows());
  fields << first.transpose(), second.transpose();
  Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(NumFieldTriples(first.cols()), first.rows());
  ThirdOrderBatch batch(static_cast<size_t>(first.cols()));
  for (Eigen::Index begin = 0; begin < elements.num_cells(); begin += kTetsAtOnce) {
    for (Eigen::Index lane = 0; lane < kTetsAtOnce; ++lane) {
      // The last tet fills the lanes behind it, which are left out below.
      const Eigen::Index tet = std::min(begin + lane, elements.num_cells() - 1);
      const Eigen::Matrix3d hats = HatGradients<4>(elements, tet);
      FillLane(elements, tet, fields, hats, lane, &batch);
      const double weight = stiffness[tet] * elements.measures[tet];
      for (Eigen::Index i = 0; i < 9; ++i) {
        batch.hats[static_cast<size_t>(i * kTetsAtOnce + lane)] = weight * hats(i % 3, i / 3);
      }
    }
    EvaluateThirdOrder(unit.shear, unit.bulk, &batch);
    const Eigen::Index end = std::min(begin + kTetsAtOnce, elements.num_cells());
    for (Eigen::Index tet = begin; tet < end; ++tet) {
      AddLane(elements, tet, tet - begin, batch, &forces);
    }
  }
  // In place: these matrices are the largest objects that are alive here.
  const Eigen::PartialPivLU<Eigen::MatrixXd> cubics(CubicsAtDirections(first.cols()));
  forces = cubics.permutationP() * forces;
  cubics.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(forces);
  cubics.matrixLU().triangularView<Eigen::Upper>().solveInPlace(forces);
  return forces.transpose();
}

}  // namespace tissueform
