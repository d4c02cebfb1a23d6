// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_rows.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
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

absl::StatusOr<SessionRecord> ReadSession(const SqlRows& rows, size_t row) {
  return SessionOf({.id = rows.Text(row, 0),
                    .owner = rows.Text(row, 1),
                    .record = rows.Text(row, 2),
                    .etag = rows.Text(row, 3),
                    .epoch = rows.Integer(row, 4),
                    .handles = rows.Integer(row, 5),
                    .poses = rows.Text(row, 6),
                    .created_s = rows.Integer(row, 7),
                    .last_used_s = rows.Integer(row, 8)});
}

absl::StatusOr<MeshRecord> ReadMesh(const SqlRows& rows, size_t row) {
  return MeshOf(rows.Text(row, 0), rows.Text(row, 1), rows.Integer(row, 2));
}

absl::StatusOr<PredictionRow> ReadPrediction(const SqlRows& rows, size_t row) {
  return PredictionOf({.id = rows.Text(row, 0),
                       .owner = rows.Text(row, 1),
                       .session = rows.Text(row, 2),
                       .positions_sha256 = rows.Text(row, 3),
                       .record = rows.Text(row, 4),
                       .case_sha256 = rows.Text(row, 5)});
}

absl::StatusOr<CaseRecord> ReadCase(const SqlRows& rows, size_t row) {
  return CaseOf({.sha256 = rows.Text(row, 0),
                 .owner = rows.Text(row, 1),
                 .record = rows.Text(row, 2),
                 .last_used_s = rows.Integer(row, 3)});
}

SealedSession::SealedSession(SessionRecord session)
    : poses(Seal(SerializePoses(session.last_poses))) {
  session.last_poses.clear();
  record = Seal(SerializeRecord(session));
}

}  // namespace tissueform
