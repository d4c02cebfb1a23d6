// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/create_deformer.h"

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
  std::vector<ContactRow> contact;  // empty: tissue sticks to bone
  std::optional<LipEdge> lip_edge;  // that a seal may hold together
  bool seals_lips = false;          // it does
  DeformationModel model = DeformationModel::kGradientField;
  double poisson_ratio = 0.45;          // of the elastic models
  GradientFieldOptions gradient_field;  // what a client can ask for; the server fills in the rest
  std::vector<HandlePose> last_poses;   // one a handle, in their order; empty: at rest

  // A fill-reducing order of the vertices (before postordering), so that a restart need not look
  // for one: a permutation of 0..n-1, whose n the reader compares with the mesh. Empty: none.
  std::vector<int32_t> node_order;

  // What makes the creation idempotent: the same id again with the same fingerprint is the same
  // request.
  std::string request_id;  // empty: every call makes a session of its own
  std::string request_fingerprint;

  // The store's; changed by it alone.
  std::string etag;         // of this version of the record
  int64_t epoch = 0;        // under which it was written
  int64_t created_s = 0;    // unix seconds
  int64_t last_used_s = 0;  // written, its poses committed, or touched
};

// The record as bytes (tissueform.store.v1.SessionRecord), without what is the store's own. Equal
// for equal records.
std::string SerializeRecord(const SessionRecord& record);

// Errors: DataLoss for bytes that are no such record, or that do not agree with themselves.
absl::StatusOr<SessionRecord> ParseRecord(absl::string_view bytes);

// The poses of a session alone (tissueform.store.v1.Poses): they change more often than the rest.
std::string SerializePoses(const std::vector<HandlePose>& poses);

// Errors: DataLoss for bytes that are no poses, or poses that CheckPose refuses.
absl::StatusOr<std::vector<HandlePose>> ParsePoses(absl::string_view bytes);

}  // namespace tissueform
