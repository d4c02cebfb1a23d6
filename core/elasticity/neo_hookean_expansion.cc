// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/elasticity/neo_hookean_expansion.h"

#include <vector>

#include <Eigen/LU>

#include "core/elasticity/material.h"

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

}  // namespace

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

}  // namespace tissueform
