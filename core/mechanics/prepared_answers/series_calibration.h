// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/answer_evaluator/series_terms.h"

namespace tissueform {

// Writes what SeriesErrorMm needs, with c and c' of 1: size_mm, estimate_scale, first_gains,
// second_gains, probes and third_gains. Displacements of some vertices, 3 v + axis, mm: `first` a
// unit of every number of a pose (see SeriesTerms), `second` of every pair, `third` of every
// triple, or no columns where the second order is the last one. The probes are the vertices that
// single pairs move most, at most 64 of them.
void DescribeSeries(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                    const Eigen::MatrixXd& third, double size_mm, PortableAnswers* answers);

// Terms with what converged answers were measured to lie away.
struct MeasuredSeries {
  SeriesTerms terms;
  double error_mm = 0;
};

// Takes for c and c' `allowance` times the median of errors over the estimates with 1. Without any
// that moves a vertex, as much as on the worst body that was tried.
void CalibrateSeries(const std::vector<MeasuredSeries>& measured, double allowance,
                     PortableAnswers* answers);

}  // namespace tissueform
