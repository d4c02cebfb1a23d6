// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "google/protobuf/repeated_ptr_field.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/problem/contact_summary.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/session.pb.h"

namespace tissueform {

using ContactRowProtos = google::protobuf::RepeatedPtrField<v1::ContactRow>;

// REQUIRES: the rows name no other handles than these.
ContactRowProtos ToProto(const std::vector<ContactRow>& rows,
                         const std::vector<HandleRegion>& handles);

// Errors: InvalidArgument, naming the row by its index, for a row that does not say what it
// touches, an unknown handle, and too many rows. The rest is checked by ConstraintSet.
absl::StatusOr<std::vector<ContactRow>> ToContactRows(const ContactRowProtos& protos,
                                                      const std::vector<HandleRegion>& handles);

v1::LipEdge ToProto(const LipEdge& edge, bool sealed);
// The rest is checked by CheckLipEdge.
LipEdge ToLipEdge(const v1::LipEdge& proto);

v1::SealSummary ToProto(const SealAnswer& seal);
SealAnswer ToSealAnswer(const v1::SealSummary& proto);

v1::ContactSummary ToProto(const ContactSummary& summary);
ContactSummary ToContactSummary(const v1::ContactSummary& proto);

}  // namespace tissueform
