// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/rotation_expansion.h"

#include <vector>

#include <Eigen/LU>

namespace tissueform {

void DescribeExpansion(const SimplexDomain& domain, const SimplexPolynomials& polynomials,
                       PortableAnswers* answers) {
  const Eigen::MatrixXd unit_nodes = InterpolationNodes(polynomials);
  Eigen::MatrixXd values(polynomials.num_terms(), polynomials.num_terms());
  Eigen::VectorXd at_node(polynomials.num_terms());
  std::vector<double> workspace;
  answers->nodes.clear();
  for (Eigen::Index node = 0; node < unit_nodes.rows(); ++node) {
    polynomials.Evaluate(unit_nodes.row(node), 0, absl::MakeSpan(at_node.data(), at_node.size()),
                         &workspace);
    values.row(node) = at_node;
    const Eigen::VectorXd u = domain.FromUnit(unit_nodes.row(node));
    answers->nodes.insert(answers->nodes.end(), u.begin(), u.end());
  }
  // An inverse and not a factorisation: it is multiplied by nine columns for every pose, its size
  // is that of the polynomials (tens to hundreds), and the points are chosen so that it is well
  // conditioned.
  const Eigen::MatrixXd interpolation = values.inverse();
  answers->interpolation.assign(interpolation.data(), interpolation.data() + interpolation.size());
  answers->numbers.degree = polynomials.degree();
  answers->numbers.simplex_width = domain.width;
  answers->simplex_low.assign(domain.low.begin(), domain.low.end());
}

int64_t RotationExpansionBytes(int dimension, int degree) {
  const int64_t terms = SimplexPolynomials::NumTerms(dimension, degree);
  // The polynomials' own table is small beside the matrix.
  return terms * (terms + dimension + 4) * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
