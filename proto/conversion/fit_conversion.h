// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mechanics/plan_fitting/fit_request.h"
#include "core/mechanics/plan_fitting/plan_fit.h"
#include "tissueform/v1/plan_service.pb.h"

namespace tissueform {

// What is wanted and may move, in LPS. Errors: InvalidArgument, where a part is missing; the rest
// is for CheckFitRequest.
absl::StatusOr<FitRequest> ToFitRequest(const v1::FitRequest& proto);

// `fit` is of `problem`.
v1::FitResponse ToProto(const FitProblem& problem, const PlanFit& fit);

}  // namespace tissueform
