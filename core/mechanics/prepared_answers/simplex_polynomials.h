// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include <Eigen/Core>

namespace tissueform {

// The simplex { u : u_i >= low_i, sum (u_i - low_i) <= width }, on which polynomials of harmonic
// values live. low = 0 and width = 1 where harmonic fields stay in [0, 1].
struct SimplexDomain {
  Eigen::VectorXd low;
  double width = 1;

  Eigen::Index dimension() const { return low.size(); }
  Eigen::VectorXd ToUnit(const Eigen::VectorXd& u) const { return (u - low) / width; }
  Eigen::VectorXd FromUnit(const Eigen::VectorXd& y) const { return low + width * y; }
};

// The smallest of them that holds all rows of `values` and the unit simplex, which ensures that the
// result is not empty after rounding. Nothing is ever extrapolated.
SimplexDomain EnclosingSimplex(const Eigen::Ref<const Eigen::MatrixXd>& values);

// Polynomials of total degree up to `degree` on the unit simplex { y >= 0, sum y <= 1 } of k
// dimensions, orthonormal for the uniform probability measure on it (Koornwinder 1975; Dunkl and Xu
// 2014, Proposition 5.3.1): with s_i = 1 - y_1 - ... - y_(i-1) and a_i = 2 (n_(i+1) + ... + n_k) +
// k - i
//   B_n(y) = prod_i sqrt((2 n_i + a_i + 1) / (k - i + 1)) s_i^(n_i) P_(n_i)^(a_i, 0)(2 y_i / s_i -
//   1),
// P the Jacobi polynomials. One dimension: Legendre polynomials. Ordered by total degree, so the
// first NumTerms(k, d) are those of degree d and below; the first one is the constant one.
class SimplexPolynomials {
 public:
  // REQUIRES: dimension >= 1, degree >= 0.
  SimplexPolynomials(int dimension, int degree);

  // Binomial coefficient (dimension + degree) over dimension.
  static Eigen::Index NumTerms(int dimension, int degree);

  int dimension() const { return dimension_; }
  int degree() const { return degree_; }
  Eigen::Index num_terms() const { return scales_.size(); }
  int64_t bytes_held() const;

  // Writes the values at `y` of the polynomials from `first` on, one for each entry of `values`.
  // `workspace` is the caller's so that threads can share this object.
  void Evaluate(const Eigen::VectorXd& y, Eigen::Index first, absl::Span<double> values,
                std::vector<double>* workspace) const;

 private:
  // One step of the recurrence of the homogeneous Jacobi polynomials,
  // J_n = (z_factor z + s_factor s) J_(n-1) - s2_factor s^2 J_(n-2).
  struct Step {
    double z_factor = 0;
    double s_factor = 0;
    double s2_factor = 0;
  };

  static Step RecurrenceStep(int n, int a);

  // Where the table holds J of degree 0 of dimension i when the later exponents sum to `rest`.
  size_t Begin(int i, int rest) const {
    return begins_[static_cast<size_t>(i * (degree_ + 1) + rest)];
  }

  int dimension_;
  int degree_;
  std::vector<size_t> begins_;
  std::vector<Step> steps_;       // one for each entry of the table
  std::vector<int32_t> factors_;  // of every term: `dimension` entries of the table
  std::vector<int32_t> degrees_;  // of every term: its total degree
  Eigen::VectorXd scales_;        // of every term: the product of the roots
};

// As many points of the unit simplex, one a row, as there are polynomials: interpolation in them is
// unique and well conditioned. Approximate Fekete points, chosen by a pivoted QR factorisation
// among a lattice that is denser towards the boundary (Sommariva and Vianello 2009).
Eigen::MatrixXd InterpolationNodes(const SimplexPolynomials& polynomials);

}  // namespace tissueform
