// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/simplex_polynomials.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include <Eigen/QR>

namespace tissueform {
namespace {

// Calls visit(n) for all n of `dimension` non-negative numbers with the given sum.
void ForEachComposition(int dimension, int sum, const std::function<void(std::vector<int>)>& visit,
                        std::vector<int> first = {}) {
  if (static_cast<int>(first.size()) + 1 == dimension) {
    first.push_back(sum);
    visit(std::move(first));
    return;
  }
  for (int n = sum; n >= 0; --n) {
    std::vector<int> longer = first;
    longer.push_back(n);
    ForEachComposition(dimension, sum - n, visit, std::move(longer));
  }
}

}  // namespace

SimplexDomain EnclosingSimplex(const Eigen::Ref<const Eigen::MatrixXd>& values) {
  SimplexDomain domain;
  // Wider than the unit simplex where obtuse tets let harmonic values leave [0, 1]: polynomials
  // grow fast outside their domain.
  domain.low = values.colwise().minCoeff().transpose().cwiseMin(0.0);
  const double largest_sum = std::max(1.0, values.rowwise().sum().maxCoeff());
  domain.width = largest_sum - domain.low.sum();
  return domain;
}

SimplexPolynomials::Step SimplexPolynomials::RecurrenceStep(int n, int a) {
  if (n == 0) {
    return {};
  }
  if (n == 1) {
    return {0.5 * (a + 2), 0.5 * a, 0};
  }
  const double m = n - 1;
  const double m2a = 2 * m + a;
  const double divisor = 2 * n * (m + a + 1) * m2a;
  return {(m2a + 1) * (m2a + 2) * m2a / divisor, (m2a + 1) * a * a / divisor,
          2 * (m + a) * m * (m2a + 2) / divisor};
}

SimplexPolynomials::SimplexPolynomials(int dimension, int degree)
    : dimension_(dimension), degree_(degree) {
  for (int i = 0; i < dimension; ++i) {
    for (int rest = 0; rest <= degree; ++rest) {
      begins_.push_back(steps_.size());
      const int a = 2 * rest + dimension - 1 - i;
      for (int n = 0; n <= degree - rest; ++n) {
        steps_.push_back(RecurrenceStep(n, a));
      }
    }
  }
  std::vector<double> scales;
  const auto add = [&](const std::vector<int>& n) {
    double squared_scale = 1;
    int rest = 0;
    std::vector<int32_t> factors(n.size());
    for (int i = dimension - 1; i >= 0; --i) {
      factors[i] = static_cast<int32_t>(Begin(i, rest)) + n[i];
      squared_scale *= (2.0 * (n[i] + rest) + dimension - i) / (dimension - i);
      rest += n[i];
    }
    factors_.insert(factors_.end(), factors.begin(), factors.end());
    scales.push_back(std::sqrt(squared_scale));
    degrees_.push_back(rest);
  };
  for (int d = 0; d <= degree; ++d) {
    ForEachComposition(dimension, d, add);
  }
  scales_ = Eigen::VectorXd::Map(scales.data(), static_cast<Eigen::Index>(scales.size()));
}

Eigen::Index SimplexPolynomials::NumTerms(int dimension, int degree) {
  Eigen::Index terms = 1;
  for (int i = 1; i <= dimension; ++i) {
    terms = terms * (degree + i) / i;
  }
  return terms;
}

int64_t SimplexPolynomials::bytes_held() const {
  return static_cast<int64_t>(begins_.size() * sizeof(size_t) + steps_.size() * sizeof(Step) +
                              (factors_.size() + degrees_.size()) * sizeof(int32_t)) +
         num_terms() * static_cast<int64_t>(sizeof(double));
}

void SimplexPolynomials::Evaluate(const Eigen::VectorXd& y, Eigen::Index first,
                                  absl::Span<double> values, std::vector<double>* workspace) const {
  workspace->resize(steps_.size());
  double* table = workspace->data();
  // As far as these need it: many ask for a few of low degree.
  const int degree = values.empty() ? 0 : degrees_[static_cast<size_t>(first) + values.size() - 1];
  double s = 1;
  for (int i = 0; i < dimension_; ++i) {
    // The homogeneous form s^n P_n(2 y / s - 1) has no division, so the corner s = 0 needs no case.
    const double z = 2 * y[i] - s;
    const int largest_rest = i + 1 < dimension_ ? degree : 0;
    for (int rest = 0; rest <= largest_rest; ++rest) {
      double* J = table + Begin(i, rest);
      const Step* step = steps_.data() + Begin(i, rest);
      J[0] = 1;
      for (int n = 1; n <= degree - rest; ++n) {
        J[n] = (step[n].z_factor * z + step[n].s_factor * s) * J[n - 1];
        if (n > 1) {
          J[n] -= step[n].s2_factor * s * s * J[n - 2];
        }
      }
    }
    s -= y[i];
  }
  const int32_t* factor = factors_.data() + dimension_ * first;
  for (size_t t = 0; t < values.size(); ++t) {
    double value = scales_[first + static_cast<Eigen::Index>(t)];
    for (int i = 0; i < dimension_; ++i) {
      value *= table[*factor++];
    }
    values[t] = value;
  }
}

Eigen::MatrixXd InterpolationNodes(const SimplexPolynomials& polynomials) {
  const int k = polynomials.dimension();
  // In one dimension exactly as many candidates as points: the Chebyshev extrema, all taken. In
  // more there is no such rule; a lattice twice as fine leaves a choice, and pivoting takes
  // greedily the point that adds most volume. The squared sine is that of Chebyshev's extrema in
  // every direction.
  const int lattice = k == 1 ? polynomials.degree() : 2 * polynomials.degree();
  std::vector<Eigen::VectorXd> candidates;
  const auto add = [&](const std::vector<int>& barycentric) {
    Eigen::VectorXd weights(k + 1);
    for (int i = 0; i <= k; ++i) {
      const double sine = std::sin(0.5 * std::numbers::pi * barycentric[i] / std::max(1, lattice));
      weights[i] = sine * sine;
    }
    candidates.emplace_back(weights.head(k) / weights.sum());
  };
  if (lattice == 0) {
    candidates.emplace_back(Eigen::VectorXd::Constant(k, 1.0 / (k + 1)));
  } else {
    ForEachComposition(k + 1, lattice, add);
  }
  const Eigen::Index terms = polynomials.num_terms();
  Eigen::MatrixXd values(terms, static_cast<Eigen::Index>(candidates.size()));
  std::vector<double> workspace;
  for (Eigen::Index c = 0; c < values.cols(); ++c) {
    polynomials.Evaluate(candidates[c], 0,
                         absl::MakeSpan(values.col(c).data(), static_cast<size_t>(terms)),
                         &workspace);
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(values);
  Eigen::MatrixXd nodes(terms, k);
  for (Eigen::Index node = 0; node < terms; ++node) {
    nodes.row(node) = candidates[factor.colsPermutation().indices()[node]];
  }
  return nodes;
}

}  // namespace tissueform
