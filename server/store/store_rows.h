// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/store/session_record.h"
#include "server/store/sql_database.h"
#include "server/store/store_records.h"

// How rows become records, and records rows; what the stores and the check at the start share. A
// statement begins with one of these selections. Errors of reading: DataLoss.
namespace tissueform {

#define TF_SELECT_SESSIONS                                                                       \
  "SELECT id, owner, record, etag, epoch, handles, poses, created_s, last_used_s FROM sessions " \
  "JOIN session_states ON session_states.key = sessions.key "
#define TF_SELECT_MESHES "SELECT sha256, record, last_used_s FROM meshes "
#define TF_SELECT_PREDICTIONS \
  "SELECT id, owner, session, positions_sha256, record, case_sha256 FROM predictions "
#define TF_SELECT_CASES "SELECT sha256, owner, record, last_used_s FROM cases "

// What stands in a row: views that live as long as it. Bytes are sealed, and
// must agree with the columns beside them.
struct SessionRow {
  absl::string_view id = {};
  absl::string_view owner = {};
  absl::string_view record = {};
  absl::string_view etag = {};
  int64_t epoch = 0;
  int64_t handles = 0;
  absl::string_view poses = {};
  int64_t created_s = 0;
  int64_t last_used_s = 0;
};
struct PredictionColumns {
  absl::string_view id = {};
  absl::string_view owner = {};
  absl::string_view session = {};
  absl::string_view positions_sha256 = {};
  absl::string_view record = {};
  absl::string_view case_sha256 = {};
};
struct CaseRow {
  absl::string_view sha256 = {};
  absl::string_view owner = {};
  absl::string_view record = {};
  int64_t last_used_s = 0;
};
// At rest: without its poses, which may be damaged alone.
absl::StatusOr<SessionRecord> SessionAtRestOf(const SessionRow& row);
absl::StatusOr<SessionRecord> SessionOf(const SessionRow& row);
absl::StatusOr<MeshRecord> MeshOf(absl::string_view sha256, absl::string_view record,
                                  int64_t last_used_s);
absl::StatusOr<PredictionRow> PredictionOf(const PredictionColumns& row);
absl::StatusOr<CaseRecord> CaseOf(const CaseRow& row);

// Rows of the selections.
absl::StatusOr<SessionRecord> ReadSession(const SqlRows& rows, size_t row);
absl::StatusOr<MeshRecord> ReadMesh(const SqlRows& rows, size_t row);
absl::StatusOr<PredictionRow> ReadPrediction(const SqlRows& rows, size_t row);
absl::StatusOr<CaseRecord> ReadCase(const SqlRows& rows, size_t row);

// A session's bytes as its two rows hold them. Poses have a row of their own.
struct SealedSession {
  explicit SealedSession(SessionRecord session);

  std::string record;
  std::string poses;
};

}  // namespace tissueform
