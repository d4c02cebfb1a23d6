// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/uncertainty/material_expansion.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// How far an answer lies from what other values of the material would have given: the 95th
// percentile of the distance, of every vertex by itself. Stiffness and Poisson's ratio only: what
// the model and the surgery err is not in it, and is larger.
struct UncertaintyBand {
  Eigen::VectorXd size_mm;    // #V
  Eigen::VectorXd normal_mm;  // #V: of the part along the normal; zero off the surface
};

// Unit normals of the surface of `mesh` with its vertices at `positions`, outwards: #V by 3, means
// of the triangles' by area; zero at vertices that are not on the surface.
Positions SurfaceNormals(const TetMesh& mesh, const Positions& positions);

// Values of the variables, #samples by #variables: a Latin hypercube, each variable in the middle
// of every one of #samples intervals of equal probability, paired at random but always in the same
// way.
Eigen::MatrixXd NormalSamples(int samples, int variables);

// By 512 samples of the polynomial of an expansion of one column. `normals` as SurfaceNormals gives
// them. Does not depend on `threads`.
UncertaintyBand SampleBand(const AnswerExpansion& expansion, const Positions& normals, int threads);

// The 95 % interval, in mm, of what an expansion of one column adds at a vertex along `direction`
// (of length 1): from the same samples, 2.5 % beyond either end.
struct BandInterval {
  double low_mm = 0;
  double high_mm = 0;
};
BandInterval SampleAlong(const AnswerExpansion& expansion, int32_t vertex,
                         const Eigen::Vector3d& direction);

// The sizes alone, quickly, from the terms of first order: the distance is then the length of a
// normal vector with covariance C, whose square is taken for a multiple of a chi-squared variable
// with tr(C)^2 / tr(C^2) degrees of freedom (Satterthwaite 1946), between 1 and 3. `fields` is
// #terms matrices 3 #V by 1 one beside the other: 3 #V by #terms. What changes a vertex' fields by
// e (Frobenius norm over all terms) changes its band by kNormal95 e at most: that is its gradient's
// largest length, of fields along one line.
Eigen::VectorXf FirstOrderBand(const Eigen::Ref<const Eigen::MatrixXf>& fields);

}  // namespace tissueform
