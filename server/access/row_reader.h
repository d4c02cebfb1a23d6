// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <compare>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "server/store/access_store.h"
#include "server/store/case_store.h"
#include "server/store/prediction_store.h"
#include "server/store/session_record.h"

namespace tissueform {

// A row of a store that decides what somebody may do.
struct RowName {
  enum class Kind { kSession, kPrediction, kCase, kMesh, kLink };

  Kind kind = Kind::kSession;
  std::string name = {};   // id, SHA-256 or digest
  std::string owner = {};  // of a case or a right to a mesh

  friend auto operator<=>(const RowName&, const RowName&) = default;
};

// What was read; nothing: there is no such row.
struct FoundRows {
  std::optional<SessionRecord> session = {};  // that was named, or that a link is of
  std::optional<PredictionRecord> prediction = {};
  std::optional<CaseRecord> of_case = {};
  AccessRows access = {};
};

// Reads single rows of a store that several servers share.
//
// Thread-safe. It knows nothing of those who ask.
class RowReader {
 public:
  virtual ~RowReader() = default;

  // Blocks, for a bounded time. Errors: Unavailable, where it cannot be found out whether there is
  // such a row.
  virtual absl::StatusOr<FoundRows> ReadRow(const RowName& row) = 0;
};

}  // namespace tissueform
