// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <random>
#include <string>
#include <vector>

#include "core/mechanics/deformation/model.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/rigid_move.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/outcome/head_registration.h"
#include "core/planning/outcome/outcome.h"

namespace tissueform::testing {

// A bundled plan with its case, as CompareOutcome takes them.
struct PreOperativeHead {
  PlanProblem problem;
  CaseFile contents;
};

// REQUIRES: a bundled plan with a viewer file ("head", "three_segments").
PreOperativeHead BundledHead(const std::string& plan);

// REQUIRES: a folder with a plan and its viewer file.
PreOperativeHead HeadOfPlan(const std::string& folder);

// Up to so many degrees about any axis, and mm along each.
RigidMove RandomMove(std::mt19937* random, double most_deg, double most_mm);

// The planned poses, each with an error of 1 mm and 1 degree at most.
std::vector<HandlePose> MissedPlan(const PreOperativeHead& pre, std::mt19937* random);

// How an operated head is made.
struct Simulation {
  DeformationModel model = DeformationModel::kNeoHookean;
  double contrast = 1;      // ModelSettings::stiffness_contrast
  double stiffer = 1;       // times the plan's stiffness, in the upper half of the mesh
  double noise_mm = 0.1;    // standard deviation of each coordinate
  RigidMove position = {};  // of the whole head afterwards
};

// The head after an operation with these poses (one a handle of the problem). The triangles of skin
// and bone are other ones than the case's.
PostOperativeHead OperatedHead(const PreOperativeHead& pre, const std::vector<HandlePose>& poses,
                               const Simulation& simulation, std::mt19937* random);

// Expects these movements of the segments, to 0.2 mm and 0.3 degrees.
void ExpectMovements(const Outcome& outcome, const std::vector<HandlePose>& real);

// Expects of the first prediction, by region, the distances that its face has from the true skin
// (in pre-operative coordinates), to 0.1 mm.
void ExpectErrorsByRegion(const Outcome& outcome, const TriangleMesh& true_skin);

}  // namespace tissueform::testing
