// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/types.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// Young's modulus, Pa, at a point of the rest shape.
using StiffnessField = std::function<double(const Eigen::Vector3d& position)>;

// A bar along z whose lower end is fixed and whose upper end is turned about its axis (Liao et al.
// 2009, Figs. 1, 5 and 6).
struct TwistProblem {
  TetMesh bar;
  StiffnessField stiffness;  // sampled at barycentres; empty: the same everywhere
  double angle_deg = 360;
  int threads = 1;
};

// A twisted bar. Ratios are against the rest shape.
struct TwistResult {
  Positions boundary_positions;  // of BoundaryOf(bar)
  double volume_ratio = 1;
  Eigen::Index inverted_tets = 0;      // none for a surface
  double turn_at_middle_deg = 0;       // of the boundary halfway along the bar, in [0, 360)
  std::vector<double> heights_mm;      // of the sections, evenly along the rest bar
  std::vector<double> section_ratios;  // area across the axis
  double SmallestSection() const;
  double LargestSection() const;
};

// The tets of the bar, with rotations spread along the harmonic field of `guidance`.
absl::StatusOr<TwistResult> TwistVolume(const TwistProblem& problem,
                                        Guidance guidance = Guidance::kCotangent);

// Its boundary surface alone.
absl::StatusOr<TwistResult> TwistSurface(const TwistProblem& problem);

// The field that spreads the rotation: 0 at the fixed end, 1 at the turned one; #V of the bar.
absl::StatusOr<Eigen::VectorXd> TwistField(const TwistProblem& problem, Guidance guidance);

}  // namespace tissueform
