// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/uncertainty_band.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include <Eigen/Geometry>

#include "core/base/parallel_for.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// A hundred times as many change the band by less than 2 %.
constexpr int kSamples = 512;

// The quantile of the standard normal distribution, by bisection: a few thousand are needed, once.
double NormalQuantile(double probability) {
  double low = -8;
  double high = 8;
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::sqrt(2.0)) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// #terms by #samples: the products of variables that the terms' fields are multiplied with.
Eigen::MatrixXd Monomials(const AnswerExpansion& expansion) {
  const Eigen::MatrixXd z = NormalSamples(kSamples, expansion.variables);
  Eigen::MatrixXd monomials(static_cast<Eigen::Index>(expansion.terms.size()), kSamples);
  for (size_t t = 0; t < expansion.terms.size(); ++t) {
    const AnswerExpansion::Term& term = expansion.terms[t];
    auto row = monomials.row(static_cast<Eigen::Index>(t));
    row = z.col(term.first).transpose();
    if (term.second != AnswerExpansion::kNone)
      row.array() *= z.col(term.second).transpose().array();
  }
  return monomials;
}

// Reorders.
double Percentile(double part, std::vector<double>* values) {
  const auto at =
      values->begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values->size()));
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

// Square roots of the 95th percentiles of chi-squared with 1, 2 and 3 degrees of freedom, and the
// parabola through them, which is off by less than 0.2 % between.
float RootOfChiSquared95(float degrees) {
  constexpr float kOne = 1.959964F;
  constexpr float kTwo = 2.447747F;
  constexpr float kThree = 2.795483F;
  const float x = degrees - 2;
  return kTwo + 0.5F * (kThree - kOne) * x + 0.5F * (kOne - 2 * kTwo + kThree) * x * x;
}

}  // namespace

Positions SurfaceNormals(const TetMesh& mesh, const Positions& positions) {
  Positions normals = Positions::Zero(mesh.num_vertices(), 3);
  const TriangleIndices facets = BoundaryFacets(mesh);
  for (Eigen::Index f = 0; f < facets.rows(); ++f) {
    const Eigen::RowVector3d corner = positions.row(facets(f, 0));
    const Eigen::RowVector3d one = positions.row(facets(f, 1)) - corner;
    const Eigen::RowVector3d other = positions.row(facets(f, 2)) - corner;
    const Eigen::RowVector3d area = one.cross(other);
    for (int c = 0; c < 3; ++c) normals.row(facets(f, c)) += area;
  }
  for (Eigen::Index v = 0; v < normals.rows(); ++v) normals.row(v).normalize();  // leaves zeros
  return normals;
}

Eigen::MatrixXd NormalSamples(int samples, int variables) {
  Eigen::MatrixXd z(samples, variables);
  std::mt19937_64 random(95);  // NOLINT(cert-msc51-cpp,cert-msc32-c): the same samples always
  for (int v = 0; v < variables; ++v) {
    for (int s = 0; s < samples; ++s) z(s, v) = NormalQuantile((s + 0.5) / samples);
    // Not std::shuffle, which every library does in its own way.
    for (int s = samples - 1; s > 0; --s) {
      std::swap(z(s, v), z(static_cast<Eigen::Index>(random() % static_cast<uint64_t>(s + 1)), v));
    }
  }
  return z;
}

UncertaintyBand SampleBand(const AnswerExpansion& expansion, const Positions& normals,
                           int threads) {
  const Eigen::MatrixXd monomials = Monomials(expansion);
  const Eigen::Index vertices = normals.rows();
  UncertaintyBand band{Eigen::VectorXd::Zero(vertices), Eigen::VectorXd::Zero(vertices)};
  constexpr Eigen::Index kGrain = 256;
  ParallelFor(threads, vertices, kGrain, [&](Eigen::Index begin, Eigen::Index end) {
    Eigen::Matrix3Xd fields(3, monomials.rows());
    Eigen::Matrix3Xd moves(3, kSamples);
    std::vector<double> values(kSamples);
    Eigen::Map<Eigen::RowVectorXd> row(values.data(), kSamples);
    for (Eigen::Index v = begin; v < end; ++v) {
      for (Eigen::Index t = 0; t < fields.cols(); ++t) {
        fields.col(t) = expansion.terms[static_cast<size_t>(t)].field.col(0).segment<3>(3 * v);
      }
      if (fields.isZero(0)) continue;
      moves.noalias() = fields * monomials;
      row = moves.colwise().norm();
      band.size_mm[v] = Percentile(0.95, &values);
      if (normals.row(v).isZero(0)) continue;
      row = (normals.row(v) * moves).cwiseAbs();
      band.normal_mm[v] = Percentile(0.95, &values);
    }
  });
  return band;
}

BandInterval SampleAlong(const AnswerExpansion& expansion, int32_t vertex,
                         const Eigen::Vector3d& direction) {
  Eigen::RowVectorXd fields(static_cast<Eigen::Index>(expansion.terms.size()));
  for (Eigen::Index t = 0; t < fields.size(); ++t) {
    const Eigen::MatrixXd& field = expansion.terms[static_cast<size_t>(t)].field;
    fields[t] = direction.dot(field.col(0).segment<3>(3 * vertex));
  }
  const Eigen::RowVectorXd along = fields * Monomials(expansion);
  std::vector<double> values(along.begin(), along.end());
  return {.low_mm = Percentile(0.025, &values), .high_mm = Percentile(0.975, &values)};
}

Eigen::VectorXf FirstOrderBand(const Eigen::Ref<const Eigen::MatrixXf>& fields) {
  Eigen::VectorXf band(fields.rows() / 3);
  for (Eigen::Index v = 0; v < band.size(); ++v) {
    const Eigen::Matrix3f covariance =
        fields.middleRows<3>(3 * v) * fields.middleRows<3>(3 * v).transpose();
    const float trace = covariance.trace();
    // Of the squares; zero where nothing moves.
    const float squares = covariance.squaredNorm();
    if (squares <= 0) {
      band[v] = 0;
      continue;
    }
    const float degrees = std::clamp(trace * trace / squares, 1.0F, 3.0F);
    band[v] = std::sqrt(squares / trace) * RootOfChiSquared95(degrees);
  }
  return band;
}

}  // namespace tissueform
