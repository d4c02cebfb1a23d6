// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/experiment.h"

#include "client/lab/experiments/accuracy_experiment.h"
#include "client/lab/experiments/blend_experiment.h"
#include "client/lab/experiments/block_pull_experiment.h"
#include "client/lab/experiments/guidance_experiment.h"
#include "client/lab/experiments/lips_experiment.h"
#include "client/lab/experiments/materials_experiment.h"
#include "client/lab/experiments/ratios_experiment.h"
#include "client/lab/experiments/solver_times_experiment.h"
#include "client/lab/experiments/twist_experiment.h"
#include "client/lab/experiments/uncertainty_experiment.h"
#include "client/lab/experiments/update_experiment.h"

namespace tissueform {

const std::vector<Experiment>& AllExperiments() {
  static const auto* const kExperiments = new std::vector<Experiment>{
      {"fig1", "volume against surface twist of 360 degrees", RunTwistExperiment},
      {"fig2", "drag and push of a layered block, volume and surface", RunBlockPullExperiment},
      {"fig3", "a bar's end moved but not turned: three ways to update gradients",
       RunUpdateExperiment},
      {"fig4", "steps and convergence of the linear and the cosine blend", RunBlendExperiment},
      {"fig5", "two materials under a twist of 360 degrees", RunMaterialsExperiment},
      {"fig6", "cotangent against uniform guidance on a graded bar", RunGuidanceExperiment},
      {"table1", "times of the factorization and of three solves", RunSolverTimesExperiment},
      {"accuracy", "all models against CalculiX, and locking (minutes; only when named; needs ccx)",
       RunAccuracyExperiment, true},
      {"lips", "contact against CalculiX, two blocks and a head (only when named; needs ccx)",
       RunLipsExperiment, true},
      {"ratios", "soft-to-hard ratios of heads beside published ranges (minutes; only when named)",
       RunRatiosExperiment, true},
      {"uncertainty",
       "the band from stiffness on two heads against full sampling (minutes; only when named)",
       RunUncertaintyExperiment, true},
  };
  return *kExperiments;
}

}  // namespace tissueform
