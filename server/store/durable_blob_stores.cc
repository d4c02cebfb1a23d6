// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_blob_stores.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/claimed_blobs.h"
#include "server/store/store_errors.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

constexpr int64_t kVertexBytes = 12;

absl::StatusOr<MeshRecord> FindMesh(Database& database, const std::string& sha256) {
  Database::Query query = database.Prepare(TF_SELECT_MESHES "WHERE sha256 = ?");
  TF_ASSIGN_OR_RETURN(const bool found, query.Bind(sha256).Step());
  if (!found) return NoMesh(sha256);
  return ReadMesh(query);
}

absl::StatusOr<PredictionRow> FindPrediction(Database& database, const std::string& id) {
  Database::Query query = database.Prepare(TF_SELECT_PREDICTIONS "WHERE id = ?");
  TF_ASSIGN_OR_RETURN(const bool found, query.Bind(id).Step());
  if (!found) return NoPrediction(id);
  return ReadPrediction(query);
}

absl::StatusOr<PredictionRecord> ReadPredictionRecord(const Database::Query& row) {
  TF_ASSIGN_OR_RETURN(PredictionRow prediction, ReadPrediction(row));
  return std::move(prediction.record);
}

absl::Status DeleteMeshRow(Database& database, const std::string& sha256) {
  const int64_t before = database.total_changes();
  TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM meshes WHERE sha256 = ?").Bind(sha256).Run());
  return database.total_changes() > before ? absl::OkStatus() : NoMesh(sha256);
}

}  // namespace

absl::Status CheckMeshBlobSize(const BlobStore& blobs, const MeshRecord& record) {
  return CheckBlobSize(blobs, record.sha256,
                       static_cast<int64_t>(record.shape.Text().size()) + record.total_bytes);
}

absl::Status CheckPositionsSize(const BlobStore& blobs, const PredictionRow& row) {
  return CheckBlobSize(blobs, row.positions_sha256, row.record.vertex_count * kVertexBytes);
}

absl::Status DurableMeshStore::Put(const MeshRecord& record, const MeshPayloadView& payload) {
  TF_RETURN_IF_ERROR(CheckMeshRecord(record, payload));
  const std::string text = record.shape.Text();
  std::vector<absl::string_view> parts = {text};
  parts.insert(parts.end(), payload.segments.begin(), payload.segments.end());
  const std::string bytes = Seal(SerializeMesh(record));
  return Claim(
      thread_, blobs_, record.sha256, blobs_->Put(record.sha256, parts), [&](Database& database) {
        return database
            .Prepare(
                "INSERT INTO meshes (sha256, record, last_used_s) VALUES (?, ?, ?) ON CONFLICT "
                "(sha256) DO UPDATE SET last_used_s = max(last_used_s, excluded.last_used_s)")
            .Bind(record.sha256)
            .BindBytes(bytes)
            .Bind(record.last_used_s)
            .Run();
      });
}

absl::StatusOr<MeshRecord> DurableMeshStore::Find(const std::string& sha256) {
  return Ask<MeshRecord>(thread_, [&](Database& database) { return FindMesh(database, sha256); });
}

absl::StatusOr<MeshPayload> DurableMeshStore::Read(const std::string& sha256) {
  absl::Status status;
  for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
    TF_ASSIGN_OR_RETURN(const MeshRecord record, Find(sha256));
    absl::StatusOr<MeshPayload> payload = ReadBlob(record);
    if (!absl::IsNotFound(payload.status())) {
      if (absl::IsDataLoss(payload.status())) {
        return SetBlobAside(thread_, blobs_, sha256, payload.status());
      }
      return payload;
    }
    status = Damaged(absl::StrCat("mesh ", sha256), "its file is missing; upload it again");
  }
  return SetBlobAside(thread_, blobs_, sha256, status);
}

absl::StatusOr<MeshPayload> DurableMeshStore::ReadBlob(const MeshRecord& record) {
  TF_RETURN_IF_ERROR(CheckMeshBlobSize(*blobs_, record));
  const std::string text = record.shape.Text();
  std::string head;  // the first bytes, until the text is whole
  MeshPayload payload(record.shape);
  int64_t offset = 0;
  TF_RETURN_IF_ERROR(blobs_->Read(record.sha256, [&](absl::string_view piece) {
    const size_t of_text = std::min(text.size() - head.size(), piece.size());
    head.append(piece.data(), of_text);
    piece.remove_prefix(of_text);
    if (offset + static_cast<int64_t>(piece.size()) > record.total_bytes) {
      return Damaged(absl::StrCat("mesh ", record.sha256), "its file has grown");
    }
    payload.Write(offset, piece);
    offset += static_cast<int64_t>(piece.size());
    return absl::OkStatus();
  }));
  if (head != text || offset != record.total_bytes) {
    return Damaged(absl::StrCat("mesh ", record.sha256), "its file belongs to another mesh");
  }
  return payload;
}

absl::StatusOr<MeshStore::Page> DurableMeshStore::List(const std::string& after, int limit) {
  if (limit < 1) return BadLimit(limit);
  return Ask<Page>(thread_, [&](Database& database) {
    Database::Query query = database.Prepare(TF_SELECT_MESHES "WHERE sha256 > ? ORDER BY sha256");
    query.Bind(after);
    return ReadPage<Page>(&query, limit, ReadMesh,
                          [](const MeshRecord& record) { return record.sha256; });
  });
}

absl::Status DurableMeshStore::Delete(const std::string& sha256) {
  return thread_->Run(
      {.work = [&](Database& database) { return DeleteMeshRow(database, sha256); },
       .after = [&](Database& database) { return RemoveUnclaimed(database, *blobs_, sha256); },
       .erases = true});
}

absl::Status DurableMeshStore::Touch(const std::vector<std::string>& sha256s, int64_t now_s) {
  return thread_->Run({.work = [&](Database& database) -> absl::Status {
    for (const std::string& sha256 : sha256s) {
      TF_RETURN_IF_ERROR(
          database.Prepare("UPDATE meshes SET last_used_s = max(last_used_s, ?) WHERE sha256 = ?")
              .Bind(now_s)
              .Bind(sha256)
              .Run());
    }
    return absl::OkStatus();
  }});
}

absl::StatusOr<std::vector<MeshRecord>> DurableMeshStore::ListUnused(int64_t before_s, int limit) {
  if (limit < 1) return BadLimit(limit);
  TF_ASSIGN_OR_RETURN(
      Page page, Ask<Page>(thread_, [&](Database& database) {
        Database::Query query =
            database.Prepare(TF_SELECT_MESHES "WHERE last_used_s < ? ORDER BY last_used_s, sha256");
        query.Bind(before_s);
        return ReadPage<Page>(&query, limit, ReadMesh,
                              [](const MeshRecord& record) { return record.sha256; });
      }));
  return std::move(page.records);
}

absl::Status DurablePredictionStore::Create(const PredictionRecord& record,
                                            const std::string& positions) {
  TF_RETURN_IF_ERROR(CheckPrediction(record, positions));
  const std::string sha256 = Sha256Hex({positions});
  const std::string bytes = Seal(SerializePrediction({record, sha256}));
  return Claim(thread_, blobs_, sha256, blobs_->Put(sha256, {positions}),
               [&](Database& database) -> absl::Status {
                 if (FindPrediction(database, record.id).ok()) return PredictionExists(record.id);
                 return database
                     .Prepare(
                         "INSERT INTO predictions (id, owner, session, case_sha256, "
                         "positions_sha256, record) "
                         "VALUES (?, ?, ?, ?, ?, ?)")
                     .Bind(record.id)
                     .Bind(record.owner)
                     .Bind(record.session)
                     .Bind(record.case_sha256)
                     .Bind(sha256)
                     .BindBytes(bytes)
                     .Run();
               });
}

absl::StatusOr<PredictionRow> DurablePredictionStore::Find(const std::string& id) {
  return Ask<PredictionRow>(thread_,
                            [&](Database& database) { return FindPrediction(database, id); });
}

absl::StatusOr<PredictionRecord> DurablePredictionStore::Get(const std::string& id) {
  TF_ASSIGN_OR_RETURN(PredictionRow row, Find(id));
  return std::move(row.record);
}

absl::StatusOr<std::string> DurablePredictionStore::Positions(const std::string& id) {
  std::string sha256;
  for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
    TF_ASSIGN_OR_RETURN(const PredictionRow row, Find(id));
    sha256 = row.positions_sha256;
    std::string positions;
    absl::Status status = CheckPositionsSize(*blobs_, row);
    if (status.ok()) {
      status = blobs_->Read(sha256, [&](absl::string_view piece) {
        positions.append(piece.data(), piece.size());
        return absl::OkStatus();
      });
    }
    if (status.ok()) return positions;
    if (absl::IsDataLoss(status)) return SetBlobAside(thread_, blobs_, sha256, status);
    if (!absl::IsNotFound(status)) return status;
  }
  return SetBlobAside(thread_, blobs_, sha256,
                      Damaged(absl::StrCat("prediction \"", id, "\""), "its file is missing"));
}

absl::StatusOr<PredictionStore::Page> DurablePredictionStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  return Ask<Page>(thread_, [&](Database& database) {
    Database::Query query =
        database.Prepare(TF_SELECT_PREDICTIONS
                         "WHERE id > ? AND (? OR owner = ? OR id IN (SELECT value FROM "
                         "json_each(?))) AND (? OR session = ?) AND (? OR case_sha256 = ?) ORDER "
                         "BY id");
    const std::string also = NamesInJson(request.also);
    const std::string owner = request.owner.value_or("");
    const std::string session = request.session.value_or("");
    const std::string case_sha256 = request.case_sha256.value_or("");
    query.Bind(request.after);
    query.Bind(int64_t{!request.owner.has_value()}).Bind(owner).Bind(also);
    query.Bind(int64_t{!request.session.has_value()}).Bind(session);
    query.Bind(int64_t{!request.case_sha256.has_value()}).Bind(case_sha256);
    return ReadPage<Page>(&query, request.limit, ReadPredictionRecord,
                          [](const PredictionRecord& record) { return record.id; });
  });
}

absl::Status DurablePredictionStore::Delete(const std::string& id) {
  std::string sha256;
  return thread_->Run(
      {.work = [&](Database& database) -> absl::Status {
         Database::Query query =
             database.Prepare("DELETE FROM predictions WHERE id = ? RETURNING positions_sha256");
         TF_ASSIGN_OR_RETURN(const bool found, query.Bind(id).Step());
         if (!found) return NoPrediction(id);
         sha256 = std::string(query.Text(0));
         return query.Run();
       },
       .after = [&](Database& database) { return RemoveUnclaimed(database, *blobs_, sha256); },
       .erases = true});
}

}  // namespace tissueform
