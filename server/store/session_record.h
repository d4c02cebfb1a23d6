// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/constraints/constraint_set.h"
#include "core/constraints/handle_pose.h"
#include "core/deformation/create_deformer.h"

namespace tissueform {

// Everything a session is made from, and nothing that can be computed again: the recipe, not the
// factor. A plain value.
struct SessionRecord {
  std::string id;                               // chosen by the client or random; one in a store
  std::string owner;                            // Principal::name; empty: anonymous
  std::string project;                          // empty: none
  std::string mesh_sha256;                      // 64 lower-case hexadecimal digits
  std::variant<double, std::string> stiffness;  // Pa for every tet, or the name of a cell array
  std::vector<int32_t> fixed;
  std::vector<HandleRegion> handles;
  DeformationModel model = DeformationModel::kGradientField;
  double poisson_ratio = 0.45;          // of the elastic models
  GradientFieldOptions gradient_field;  // what a client can ask for; the server fills in the rest
  std::vector<HandlePose> last_poses;   // one a handle, in their order; empty: at rest

  // What makes the creation idempotent: the same id again with the same fingerprint is the same
  // request.
  std::string request_id;  // empty: every call makes a session of its own
  std::string request_fingerprint;

  // The store's; changed by it alone.
  std::string etag;   // of this version of the record
  int64_t epoch = 0;  // under which it was written
};

// The record as bytes (tissueform.store.v1.SessionRecord), without the store's own two. Equal for
// equal records.
std::string SerializeRecord(const SessionRecord& record);

// Errors: DataLoss for bytes that are no such record, or that do not agree with themselves.
absl::StatusOr<SessionRecord> ParseRecord(absl::string_view bytes);

}  // namespace tissueform
