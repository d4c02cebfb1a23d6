// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/store/access_store/access_store.h"

// Rows of an AccessStore as a table holds them: by key, and as bytes (tissueform.store.v1).
namespace tissueform {

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
