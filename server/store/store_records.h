// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/store/case_store.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/upload_store.h"

namespace tissueform {

// Records as bytes (tissueform.store.v1), and back. Parsing errors are DataLoss: the bytes are no
// such record, or do not agree with themselves. (session_record.h has those of sessions.)

// Without last_used_s, which changes.
std::string SerializeMesh(const MeshRecord& record);
absl::StatusOr<MeshRecord> ParseMesh(absl::string_view bytes);

std::string SerializeAnnouncement(const UploadAnnouncement& announcement);
absl::StatusOr<UploadAnnouncement> ParseAnnouncement(absl::string_view bytes);

// A prediction as a row holds it.
struct PredictionRow {
  PredictionRecord record;
  std::string positions_sha256;
};
std::string SerializePrediction(const PredictionRow& row);
absl::StatusOr<PredictionRow> ParsePrediction(absl::string_view bytes);

// Without last_used_s, which changes.
std::string SerializeCaseRecord(const CaseRecord& record);
absl::StatusOr<CaseRecord> ParseCaseRecord(absl::string_view bytes);

// InvalidArgument when a mesh of this shape cannot have that name and size.
absl::Status CheckAnnouncement(const UploadAnnouncement& announcement);

// Bytes with their SHA-256 before them: SQLite itself does not notice a flipped bit in a row.
std::string Seal(absl::string_view bytes);
// What was sealed, a part of `sealed`. Errors: DataLoss.
absl::StatusOr<absl::string_view> Unseal(absl::string_view sealed);

}  // namespace tissueform
