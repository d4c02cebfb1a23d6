// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_rows.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// Columns of the selections that have names here.
enum SessionColumn { kId = 1, kOwner, kRecord, kEtag, kEpoch, kHandles, kPoses, kCreated, kUsed };

SessionRow ToSessionRow(const Database::Query& row) {
  return {.id = row.Text(kId),
          .owner = row.Text(kOwner),
          .record = row.Bytes(kRecord),
          .etag = row.Text(kEtag),
          .epoch = row.Integer(kEpoch),
          .handles = row.Integer(kHandles),
          .poses = row.Bytes(kPoses),
          .created_s = row.Integer(kCreated),
          .last_used_s = row.Integer(kUsed)};
}

}  // namespace

absl::StatusOr<SessionRecord> SessionAtRestOf(const SessionRow& row) {
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(row.record));
  TF_ASSIGN_OR_RETURN(SessionRecord record, ParseRecord(bytes));
  record.etag = std::string(row.etag);
  record.epoch = row.epoch;
  record.created_s = row.created_s;
  record.last_used_s = row.last_used_s;
  if (record.id != row.id || record.owner != row.owner) {
    return Damaged("a session's record", "it belongs to another");
  }
  if (record.etag.empty() || row.handles != static_cast<int64_t>(record.handles.size())) {
    return Damaged("a session's record", "it does not match its state");
  }
  return record;
}

absl::StatusOr<SessionRecord> SessionOf(const SessionRow& row) {
  TF_ASSIGN_OR_RETURN(SessionRecord record, SessionAtRestOf(row));
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(row.poses));
  TF_ASSIGN_OR_RETURN(record.last_poses, ParsePoses(bytes));
  if (CheckPoseCount(record.id, record.last_poses.size(), record.handles.size()).ok()) {
    return record;
  }
  return Damaged("a session's record", "its poses do not match its handles");
}

absl::StatusOr<MeshRecord> MeshOf(absl::string_view sha256, absl::string_view record_bytes,
                                  int64_t last_used_s) {
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(record_bytes));
  TF_ASSIGN_OR_RETURN(MeshRecord record, ParseMesh(bytes));
  if (record.sha256 != sha256) return Damaged("a mesh's record", "it belongs to another");
  record.last_used_s = last_used_s;
  return record;
}

absl::StatusOr<PredictionRow> PredictionOf(const PredictionColumns& row) {
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(row.record));
  TF_ASSIGN_OR_RETURN(PredictionRow prediction, ParsePrediction(bytes));
  const PredictionRecord& record = prediction.record;
  if (record.id != row.id || record.owner != row.owner || record.session != row.session ||
      prediction.positions_sha256 != row.positions_sha256 ||
      record.case_sha256 != row.case_sha256) {
    return Damaged("a prediction's record", "it belongs to another");
  }
  return prediction;
}

absl::StatusOr<CaseRecord> CaseOf(const CaseRow& row) {
  TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(row.record));
  TF_ASSIGN_OR_RETURN(CaseRecord record, ParseCaseRecord(bytes));
  if (record.sha256 != row.sha256 || record.owner != row.owner) {
    return Damaged("a case's record", "it belongs to another");
  }
  record.last_used_s = row.last_used_s;
  return record;
}

absl::StatusOr<SessionRecord> ReadSessionAtRest(const Database::Query& row) {
  return SessionAtRestOf(ToSessionRow(row));
}

absl::StatusOr<SessionRecord> ReadSession(const Database::Query& row) {
  return SessionOf(ToSessionRow(row));
}

absl::StatusOr<MeshRecord> ReadMesh(const Database::Query& row) {
  return MeshOf(row.Text(1), row.Bytes(2), row.Integer(3));
}

absl::StatusOr<PredictionRow> ReadPrediction(const Database::Query& row) {
  return PredictionOf({.id = row.Text(1),
                       .owner = row.Text(2),
                       .session = row.Text(3),
                       .positions_sha256 = row.Text(4),
                       .record = row.Bytes(5),
                       .case_sha256 = row.Text(6)});
}

absl::StatusOr<CaseRecord> ReadCaseRow(const Database::Query& row) {
  return CaseOf({.sha256 = row.Text(1),
                 .owner = row.Text(2),
                 .record = row.Bytes(3),
                 .last_used_s = row.Integer(4)});
}

std::string NamesInJson(const std::set<std::string>& names) {
  if (names.empty()) return "[]";
  return absl::StrCat("[\"", absl::StrJoin(names, "\",\""), "\"]");
}

absl::StatusOr<bool> IsClaimed(Database& database, const std::string& sha256) {
  Database::Query query = database.Prepare(
      "SELECT EXISTS (SELECT 1 FROM meshes WHERE sha256 = ?1) OR "
      "EXISTS (SELECT 1 FROM cases WHERE sha256 = ?1) OR "
      "EXISTS (SELECT 1 FROM predictions WHERE positions_sha256 = ?1)");
  TF_RETURN_IF_ERROR(query.Bind(sha256).Step().status());
  return query.Integer(0) != 0;
}

absl::Status RemoveUnclaimed(Database& database, BlobStore& blobs, const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(const bool claimed, IsClaimed(database, sha256));
  return claimed ? absl::OkStatus() : blobs.Remove(sha256);
}

absl::Status DeleteClaims(Database& database, const std::string& sha256) {
  for (const char* statement :
       {"DELETE FROM meshes WHERE sha256 = ?", "DELETE FROM cases WHERE sha256 = ?",
        "DELETE FROM predictions WHERE positions_sha256 = ?"}) {
    TF_RETURN_IF_ERROR(database.Prepare(statement).Bind(sha256).Run());
  }
  return absl::OkStatus();
}

}  // namespace tissueform
