// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "Eigen/Core"
#include "client/cpp/tissueform_client.h"
#include "core/planning/case_file/case_file.h"
#include "tissueform/v1/prediction.pb.h"

namespace tissueform {

// Of each vertex of the mesh the distance in mm within which the prediction stays in 95 of 100
// cases if nothing but the material is in doubt, by linear elasticity in first order. Empty where
// nothing is known of it: WhyNoMaterialBand says why, or the poses move so far that prepared
// answers do not cover them.
//
// Makes a session of the case for it, a second or two of the server's time, and deletes it again.
// Errors: the server's; DataLoss (the case's request or ranges are no messages).
absl::StatusOr<std::vector<double>> AskMaterialBand(TissueformClient* client,
                                                    const CaseFile& contents,
                                                    const v1::Prediction& prediction);

// Why a prediction has no band, in words for a report, found without a request: the case gives no
// ranges, the model is not elastic, it was predicted with another stiffness than the case's,
// or a segment turns so far that linear elasticity takes it for strain. Empty where there may be
// one, and where the case is damaged.
std::string WhyNoMaterialBand(const CaseFile& contents, const v1::Prediction& prediction);

// A band in a file of the bridge: as it is in memory, on this machine alone. One of another length
// than `vertices` counts as not kept; one of length 0 says that there is no band.
std::optional<std::vector<double>> ReadBandFile(const std::string& path, Eigen::Index vertices);
// Durable when it returns. Errors: the disk's.
absl::Status WriteBandFile(const std::string& path, const std::vector<double>& band_mm);

}  // namespace tissueform
