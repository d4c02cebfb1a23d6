// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <set>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// A bar along z whose lower end is fixed and whose upper end is moved along x without turning
// (Liao et al. 2009, Figs. 3 and 4).
struct TranslationProblem {
  TetMesh bar;
  double translation_mm = 0;
  int threads = 1;
};

// How rotations are estimated, one iteration after the other.
struct IterationScheme {
  BlendMap blend = BlendMap::kCosine;
  int acceleration_depth = 0;  // 0: the source's plain iteration
  int max_updates = 20;        // rotations estimated and reconstructed
  double tolerance_mm = 1e-3;
};

struct TranslationResult {
  Positions positions;
  std::vector<double> changes_mm;  // largest vertex change of every update
  bool converged = false;
  std::map<int, Positions> after_update;  // those asked for; 0 is the plain reconstruction
};

// Plain reconstruction (Eq. 6): the start of every scheme, which is what explicit propagation makes
// of a translation (Fig. 3a).
absl::StatusOr<Positions> TranslatePlainly(const TranslationProblem& problem);

// Iterates from the plain reconstruction and keeps the answers after the updates in `keep`; an
// iteration that ends earlier stands for the later ones.
absl::StatusOr<TranslationResult> TranslateByIteration(const TranslationProblem& problem,
                                                       const IterationScheme& scheme,
                                                       const std::set<int>& keep);

// The direction into which each tet's blended rotation, estimated from `positions`, turns the
// bar's axis: the gradient that the next reconstruction gets. #T by 3, unit length.
absl::StatusOr<Positions> TurnedAxes(const TranslationProblem& problem, const Positions& positions,
                                     BlendMap blend);

// Largest and mean distance of corresponding vertices, mm.
double LargestDistance(const Positions& a, const Positions& b);
double MeanDistance(const Positions& a, const Positions& b);

}  // namespace tissueform
