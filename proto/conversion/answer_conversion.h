// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/model.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/session.pb.h"

// Conversions of what an answer and a preparation report besides positions; all fields both ways.
namespace tissueform {

v1::SolveSummary ToProto(const SolveSummary& summary);
SolveSummary ToSolveSummary(const v1::SolveSummary& summary);

// Also with the contact of the answer.
v1::SolveSummary ToSummaryProto(const Deformation& deformation, DeformationModel model);

v1::DeformationQuality ToProto(const DeformationQuality& quality);
DeformationQuality ToDeformationQuality(const v1::DeformationQuality& quality);

// The fields of `session` that describe its preparation. bytes_held is that of the whole session.
void SetPreparation(const PreparationSummary& preparation, v1::Session* session);
PreparationSummary ToPreparationSummary(const v1::Session& session);

}  // namespace tissueform
