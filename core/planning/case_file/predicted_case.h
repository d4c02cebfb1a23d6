// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// Where everything of a case goes that is shown, in LPS and mm; at rest it lies as the case has it.
struct PredictedCase {
  std::vector<FloatPositions> surfaces;       // one a surface of the case
  std::vector<Eigen::Vector3d> landmarks_mm;  // one a landmark
};

// Of the case's tet mesh, #V by 3.
Positions RestPositions(const CaseMesh& mesh);

// `deformed` are the positions of the case's tet mesh (#V by 3), `poses` those of its handles by
// their names. A surface follows the mesh where it says how, else it moves with its handle, else
// it stays; landmarks likewise.
//
// Errors: InvalidArgument: not as many positions as the mesh has vertices, or one that is no
// number, or beyond what float32 holds; a handle of a surface or landmark without a pose.
absl::StatusOr<PredictedCase> PredictCase(const CaseFile& contents, const Positions& deformed,
                                          const std::map<std::string, HandlePose>& poses);

}  // namespace tissueform
