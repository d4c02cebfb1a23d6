// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/rotation_expansion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/LU>

#include "core/mechanics/prepared_answers/small_product.h"

namespace tissueform {
namespace {

// Rotation vector and scale at harmonic values u.
struct Blend {
  Eigen::Vector3d rotation_vector = Eigen::Vector3d::Zero();
  double scale = 1;
};

Blend BlendAt(absl::Span<const HandlePose> poses,
              const Eigen::Ref<const Eigen::VectorXd, 0, Eigen::InnerStride<>>& u) {
  Blend blend;
  for (size_t h = 0; h < poses.size(); ++h) {
    const double value = u[static_cast<Eigen::Index>(h)];
    blend.rotation_vector += value * poses[h].rotation_vector;
    blend.scale += value * (poses[h].scale - 1.0);
  }
  return blend;
}

// Of turning by vectors in a ball of radius r, after polynomials of degree n.
double Remainder(double r, int n) {
  constexpr double kLebesgueAllowance = 16;
  const double taylor = std::exp((n + 1) * std::log(r) - std::lgamma(n + 2));
  return std::min(1.0, std::ldexp(kLebesgueAllowance, -n)) * taylor;
}

}  // namespace

RotationExpansion::RotationExpansion(const SimplexDomain& domain, int degree)
    : domain_(domain), polynomials_(static_cast<int>(domain.dimension()), degree) {
  const Eigen::MatrixXd unit_nodes = InterpolationNodes(polynomials_);
  Eigen::MatrixXd values(polynomials_.num_terms(), polynomials_.num_terms());
  nodes_.resize(unit_nodes.rows(), unit_nodes.cols());
  Eigen::VectorXd at_node(polynomials_.num_terms());
  std::vector<double> workspace;
  for (Eigen::Index node = 0; node < nodes_.rows(); ++node) {
    polynomials_.Evaluate(unit_nodes.row(node), 0, absl::MakeSpan(at_node.data(), at_node.size()),
                          &workspace);
    values.row(node) = at_node;
    nodes_.row(node) = domain_.FromUnit(unit_nodes.row(node));
  }
  // An inverse and not a factorisation: it is multiplied by nine columns for every pose, its size
  // is that of the polynomials (tens to hundreds), and the points are chosen so that it is well
  // conditioned.
  interpolation_ = values.inverse();
}

ExpansionCoefficients RotationExpansion::Expand(absl::Span<const HandlePose> poses) const {
  ExpansionCoefficients at_nodes(nodes_.rows(), 9);
  for (Eigen::Index node = 0; node < nodes_.rows(); ++node) {
    const Blend blend = BlendAt(poses, nodes_.row(node).transpose());
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(at_nodes.row(node).data()) =
        blend.scale * RotationMatrix(blend.rotation_vector) - Eigen::Matrix3d::Identity();
  }
  return MultiplySmall(interpolation_, at_nodes);
}

double RotationExpansion::RemainderBound(absl::Span<const HandlePose> poses, int degree) const {
  const Eigen::Index k = domain_.dimension();
  std::vector<Blend> corners = {BlendAt(poses, domain_.low)};
  for (Eigen::Index h = 0; h < k; ++h) {
    corners.push_back(BlendAt(poses, domain_.FromUnit(Eigen::VectorXd::Unit(k, h))));
  }
  // Mixed rotation vectors fill the polytope of the corners, and the furthest two points of that
  // are two corners.
  double diameter = 0;
  double smallest_scale = corners.front().scale;
  double largest_scale = corners.front().scale;
  for (const Blend& a : corners) {
    for (const Blend& b : corners) {
      diameter = std::max(diameter, (a.rotation_vector - b.rotation_vector).norm());
    }
    smallest_scale = std::min(smallest_scale, a.scale);
    largest_scale = std::max(largest_scale, a.scale);
  }
  if (diameter == 0) {
    return 0;  // the scale alone is linear in u
  }
  const double dimension = static_cast<double>(k);
  const double radius = diameter * std::sqrt(dimension / (2 * dimension + 2));
  return 0.5 * (largest_scale + smallest_scale) * Remainder(radius, degree) +
         0.5 * (largest_scale - smallest_scale) * Remainder(radius, degree - 1);
}

void RotationExpansion::Describe(PortableAnswers* answers) const {
  answers->numbers.degree = polynomials_.degree();
  answers->numbers.simplex_width = domain_.width;
  answers->simplex_low.assign(domain_.low.begin(), domain_.low.end());
  const RowMajorMatrix<double> nodes = nodes_;
  const RowMajorMatrix<double> interpolation = interpolation_;
  answers->nodes.assign(nodes.data(), nodes.data() + nodes.size());
  answers->interpolation.assign(interpolation.data(), interpolation.data() + interpolation.size());
}

int64_t RotationExpansion::bytes_held() const {
  return polynomials_.bytes_held() +
         (nodes_.size() + interpolation_.size()) * static_cast<int64_t>(sizeof(double));
}

int64_t RotationExpansion::BytesNeeded(int dimension, int degree) {
  const int64_t terms = SimplexPolynomials::NumTerms(dimension, degree);
  // The polynomials' own table is small beside the matrix.
  return terms * (terms + dimension + 4) * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
