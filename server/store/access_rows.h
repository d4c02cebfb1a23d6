// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// Rows that decide who may do what, by key, and as bytes (tissueform.store.v1).
namespace tissueform {

// What a principal may do with another's resource. Each role includes those before it.
enum class ShareRole { kViewer = 1, kPlanner = 2 };

// By owner, resource and principal there is one.
struct ShareRow {
  // "sessions/{id}", "cases/{sha256}", "predictions/{id}", or "projects/{name}": all that the owner
  // has in the project.
  std::string resource = {};
  std::string owner = {};
  std::string principal = {};  // that may use it
  ShareRole role = ShareRole::kViewer;

  friend bool operator==(const ShareRow&, const ShareRow&) = default;
};

struct FollowLinkRow {
  std::string digest = {};  // SHA-256 of its token
  std::string session = {};
  std::string maker = {};
  std::string case_sha256 = {};  // that it opens, too; empty: none
  int64_t expires_s = 0;         // unix seconds

  friend bool operator==(const FollowLinkRow&, const FollowLinkRow&) = default;
};

// Who has sent the bytes of a mesh.
struct MeshRight {
  std::string principal = {};
  std::string sha256 = {};
  int64_t bytes = 0;  // of the mesh

  friend bool operator==(const MeshRight&, const MeshRight&) = default;
};

// One a row; names hold no line feed.
std::string KeyOf(const ShareRow& row);
std::string KeyOf(const FollowLinkRow& row);
std::string KeyOf(const MeshRight& row);

std::string SerializeRow(const ShareRow& row);
std::string SerializeRow(const FollowLinkRow& row);
std::string SerializeRow(const MeshRight& row);

// Errors: DataLoss, for bytes that are no such row.
absl::Status ParseRow(absl::string_view bytes, ShareRow* row);
absl::Status ParseRow(absl::string_view bytes, FollowLinkRow* row);
absl::Status ParseRow(absl::string_view bytes, MeshRight* row);

}  // namespace tissueform
