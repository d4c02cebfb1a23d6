// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/platform/storage/database.h"
#include "server/store/blob_store.h"
#include "server/store/session_record.h"
#include "server/store/store_records.h"

// How rows become records; what the stores of a database and its check at the start share. A
// statement begins with one of these selections. Errors of reading: DataLoss.
namespace tissueform {

#define TF_SELECT_SESSIONS                                                           \
  "SELECT sessions.key, id, owner, record, etag, epoch, handles, poses, created_s, " \
  "last_used_s FROM sessions LEFT JOIN session_states ON session_states.key = sessions.key "
#define TF_SELECT_MESHES "SELECT key, sha256, record, last_used_s FROM meshes "
#define TF_SELECT_PREDICTIONS \
  "SELECT key, id, owner, session, positions_sha256, record, case_sha256 FROM predictions "
#define TF_SELECT_CASES "SELECT key, sha256, owner, record, last_used_s FROM cases "

// What stands in a row, of whatever database: views that live as long as it. Bytes are sealed, and
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
absl::StatusOr<SessionRecord> SessionAtRestOf(const SessionRow& row);
absl::StatusOr<SessionRecord> SessionOf(const SessionRow& row);
absl::StatusOr<MeshRecord> MeshOf(absl::string_view sha256, absl::string_view record,
                                  int64_t last_used_s);
absl::StatusOr<PredictionRow> PredictionOf(const PredictionColumns& row);
absl::StatusOr<CaseRecord> CaseOf(const CaseRow& row);

// At rest: without its poses, which may be damaged alone.
absl::StatusOr<SessionRecord> ReadSessionAtRest(const Database::Query& row);
absl::StatusOr<SessionRecord> ReadSession(const Database::Query& row);
absl::StatusOr<MeshRecord> ReadMesh(const Database::Query& row);
absl::StatusOr<PredictionRow> ReadPrediction(const Database::Query& row);
absl::StatusOr<CaseRecord> ReadCaseRow(const Database::Query& row);

// A list of names for json_each. REQUIRES: they are letters, digits and "-".
std::string NamesInJson(const std::set<std::string>& names);

// Removes the blob when no row claims it.
absl::Status RemoveUnclaimed(Database& database, BlobStore& blobs, const std::string& sha256);
absl::StatusOr<bool> IsClaimed(Database& database, const std::string& sha256);
// Deletes all rows that claim it.
absl::Status DeleteClaims(Database& database, const std::string& sha256);

}  // namespace tissueform
