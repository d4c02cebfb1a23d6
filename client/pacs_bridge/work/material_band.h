// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "client/cpp/tissueform_client.h"
#include "core/case_file/case_file.h"
#include "tissueform/v1/prediction.pb.h"

namespace tissueform {

// Of each vertex of the mesh the distance in mm within which the prediction stays in 95 of 100
// cases if nothing but the material is in doubt, by linear elasticity in first order. Empty where
// nothing is known of it: the case gives no ranges, the model is none of elasticity, the poses are
// beyond what is prepared, or it was predicted with another stiffness than the case's.
//
// Makes a session of the case for it, a second or two of the server's time, and deletes it again.
// Errors: the server's; DataLoss (the case's request or ranges are no messages).
absl::StatusOr<std::vector<double>> AskMaterialBand(TissueformClient* client,
                                                    const CaseFile& contents,
                                                    const v1::Prediction& prediction);

}  // namespace tissueform
