// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_catalog.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "core/mesh_payload/sha256.h"

namespace tissueform {
namespace {

// Upper bounds of what validation and the search for the skin hold at their peak, beside the mesh.
// The most a tet takes are the four facets of the skin's search at 20 bytes, twice where all are
// boundary, or four keys of 24 bytes in the search for facets with a third tet.
constexpr int64_t kValidationBytesPerTet = 256;
constexpr int64_t kValidationBytesPerVertex = 64;

absl::Status CheckCount(int64_t count, int64_t max, absl::string_view field,
                        absl::string_view option) {
  if (count <= 0) {
    return absl::InvalidArgumentError(absl::StrCat(field, " is ", count, "; it must be positive"));
  }
  if (count > max) {
    return WithReason(
        absl::ResourceExhaustedError(absl::StrCat(field, " is ", count, ", and the server takes ",
                                                  max, " at most; raise its ", option)),
        ErrorReason::kMeshTooLarge, {{"field", std::string(field)}, {"limit", absl::StrCat(max)}});
  }
  return absl::OkStatus();
}

absl::Status CheckCellArrayNames(const std::vector<std::string>& names,
                                 const ServiceLimits& limits) {
  if (names.size() > static_cast<size_t>(limits.max_cell_arrays)) {
    return absl::InvalidArgumentError(absl::StrCat("mesh has ", names.size(), " cell arrays; send ",
                                                   limits.max_cell_arrays, " at most"));
  }
  std::set<absl::string_view> seen;
  for (const std::string& name : names) {
    if (name.empty() || name.size() > static_cast<size_t>(limits.max_name_bytes)) {
      return absl::InvalidArgumentError(absl::StrCat("name of cell array ", seen.size(), " has ",
                                                     name.size(), " bytes; it needs 1 to ",
                                                     limits.max_name_bytes));
    }
    if (!seen.insert(name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("cell array \"", name, "\" is named twice; names must differ"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckAnnouncement(const MeshAnnouncement& mesh, const ServiceLimits& limits) {
  const MeshPayloadShape& shape = mesh.shape;
  TF_RETURN_IF_ERROR(
      CheckCount(shape.num_vertices, limits.max_vertices, "vertex_count", "--max-vertices"));
  TF_RETURN_IF_ERROR(CheckCount(shape.num_tets, limits.max_tets, "tet_count", "--max-tets"));
  TF_RETURN_IF_ERROR(CheckCellArrayNames(shape.cell_arrays, limits));
  if (mesh.total_bytes != shape.TotalBytes()) {
    return absl::InvalidArgumentError(
        absl::StrCat("total_bytes is ", mesh.total_bytes, ", but ", shape.num_vertices,
                     " vertices, ", shape.num_tets, " tets and ", shape.cell_arrays.size(),
                     " cell arrays make ", shape.TotalBytes(), " bytes; correct the header"));
  }
  TF_RETURN_IF_ERROR(
      CheckCount(mesh.total_bytes, limits.max_mesh_bytes, "total_bytes", "--max-mesh-mib"));
  if (!IsSha256Hex(mesh.sha256)) {
    return absl::InvalidArgumentError("sha256 must be 64 lower-case hexadecimal digits");
  }
  return absl::OkStatus();
}

absl::Status CheckCellArraysFinite(const std::vector<CellArray>& arrays) {
  for (const CellArray& array : arrays) {
    for (Eigen::Index t = 0; t < array.values.size(); ++t) {
      if (!std::isfinite(array.values[t])) {
        return absl::InvalidArgumentError(absl::StrCat("cell array \"", array.name,
                                                       "\" is not finite at tet ", t,
                                                       "; replace NaN and infinite values"));
      }
    }
  }
  return absl::OkStatus();
}

// What a mesh takes while it is checked or read.
int64_t PeakBytes(const MeshAnnouncement& mesh) {
  return mesh.total_bytes + kValidationBytesPerTet * mesh.shape.num_tets +
         kValidationBytesPerVertex * mesh.shape.num_vertices;
}

absl::Status NoSuchMesh() {
  return WithReason(absl::NotFoundError("the server does not have this mesh; upload it"),
                    ErrorReason::kMeshNotFound);
}

}  // namespace

const CellArray* StoredMesh::FindCellArray(absl::string_view name) const {
  const auto found = std::find_if(cell_arrays.begin(), cell_arrays.end(),
                                  [name](const CellArray& array) { return array.name == name; });
  return found == cell_arrays.end() ? nullptr : &*found;
}

MeshRecord RecordOf(const StoredMesh& mesh) {
  MeshRecord record;
  record.sha256 = mesh.sha256;
  record.shape = {.num_vertices = mesh.mesh.num_vertices(),
                  .num_tets = mesh.mesh.num_tets(),
                  .cell_arrays = {}};
  for (const CellArray& array : mesh.cell_arrays) record.shape.cell_arrays.push_back(array.name);
  record.total_bytes = record.shape.TotalBytes();
  record.skin_vertex_count = static_cast<int64_t>(mesh.skin.size());
  return record;
}

MeshUpload::MeshUpload(MeshAnnouncement announcement, int64_t max_chunk_bytes,
                       MemoryReservation reservation)
    : announcement_(std::move(announcement)),
      max_chunk_bytes_(max_chunk_bytes),
      reservation_(std::move(reservation)),
      payload_(announcement_.shape) {}

absl::Status MeshUpload::Write(int64_t offset, absl::string_view data, bool finish) {
  const auto size = static_cast<int64_t>(data.size());
  if (finished_) {
    return absl::InvalidArgumentError(
        "chunk after finish_write; send nothing after the last chunk");
  }
  if (size > max_chunk_bytes_) {
    return absl::InvalidArgumentError(absl::StrCat("chunk at ", offset, " has ", size,
                                                   " bytes; send ", max_chunk_bytes_, " at most"));
  }
  if (offset != committed_bytes_) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrCat("chunk begins at ", offset, ", but ", committed_bytes_,
                                       " bytes have come; send chunks without gaps")),
                      ErrorReason::kChunkOutOfPlace,
                      {{"committed_bytes", absl::StrCat(committed_bytes_)}});
  }
  if (size > announcement_.total_bytes - committed_bytes_) {
    return absl::InvalidArgumentError(absl::StrCat("chunk at ", offset, " with ", size,
                                                   " bytes goes past the end of the ",
                                                   announcement_.total_bytes, " declared bytes"));
  }
  payload_.Write(offset, data);
  committed_bytes_ += size;
  finished_ = finish;
  if (finish && committed_bytes_ != announcement_.total_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("finish_write after ", committed_bytes_, " of ",
                                                   announcement_.total_bytes,
                                                   " declared bytes; send the rest"));
  }
  return absl::OkStatus();
}

MeshCatalog::MeshCatalog(const ServiceLimits& limits, MemoryBudget* budget, MeshStore* store,
                         const Clock* clock, UnixClock unix_clock)
    : limits_(limits),
      budget_(budget),
      store_(store),
      clock_(clock),
      unix_clock_(std::move(unix_clock)) {}

class MeshCatalog::Arrival {
 public:
  Arrival(MeshCatalog* catalog, std::string sha256)
      : catalog_(catalog), sha256_(std::move(sha256)) {
    MutexLock lock(catalog_->mutex_);
    while (catalog_->removing_ == sha256_) catalog_->removed_.Wait(catalog_->mutex_);
    catalog_->arriving_.insert(sha256_);
  }
  ~Arrival() {
    MutexLock lock(catalog_->mutex_);
    catalog_->arriving_.erase(catalog_->arriving_.find(sha256_));
  }
  Arrival(const Arrival&) = delete;
  Arrival& operator=(const Arrival&) = delete;

 private:
  MeshCatalog* const catalog_;
  const std::string sha256_;
};

absl::StatusOr<std::unique_ptr<MeshUpload>> MeshCatalog::StartUpload(
    MeshAnnouncement announcement) {
  TF_RETURN_IF_ERROR(CheckAnnouncement(announcement, limits_));
  TF_ASSIGN_OR_RETURN(MemoryReservation reservation,
                      budget_->Reserve(PeakBytes(announcement), "mesh"));
  return std::unique_ptr<MeshUpload>(
      new MeshUpload(std::move(announcement), limits_.max_chunk_bytes, std::move(reservation)));
}

absl::StatusOr<std::shared_ptr<const StoredMesh>> MeshCatalog::Finish(
    std::unique_ptr<MeshUpload> upload) {
  const std::string& sha256 = upload->announcement_.sha256;
  if (upload->payload_.View().Sha256() != sha256) {
    return WithReason(
        absl::DataLossError(
            "the payload does not have the declared SHA-256: it was damaged on its way, or the "
            "digest was computed over something else (see MeshHeader.sha256); send it again"),
        ErrorReason::kMeshDamagedOnItsWay);
  }
  TF_RETURN_IF_ERROR(CheckCellArraysFinite(upload->payload_.cell_arrays()));
  TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(upload->payload_.positions()),
                                                    std::move(upload->payload_.tets())));
  TF_RETURN_IF_ERROR(CheckTetMesh(mesh));
  std::vector<int32_t> skin = BoundaryVertices(mesh);
  TF_RETURN_IF_ERROR(upload->reservation_.Resize(
      upload->announcement_.total_bytes + static_cast<int64_t>(skin.size() * sizeof(int32_t)),
      "mesh"));
  auto stored = std::make_shared<const StoredMesh>(
      StoredMesh{std::move(upload->reservation_), sha256, std::move(mesh),
                 std::move(upload->payload_.cell_arrays()), std::move(skin)});

  const Arrival arrival(this, sha256);
  if (store_ != nullptr) {
    MeshRecord record = RecordOf(*stored);
    record.created_s = record.last_used_s = unix_clock_();
    TF_RETURN_IF_ERROR(store_->Put(
        record,
        ViewMeshPayload(stored->mesh.positions(), stored->mesh.tets(), stored->cell_arrays)));
  }
  return Add(std::move(stored));
}

std::shared_ptr<const StoredMesh> MeshCatalog::Add(std::shared_ptr<const StoredMesh> mesh) {
  MutexLock lock(mutex_);
  Entry& entry = meshes_[mesh->sha256];
  if (entry.mesh == nullptr) {
    entry.mesh = std::move(mesh);
  }
  entry.last_used = clock_->Now();
  return entry.mesh;
}

absl::StatusOr<std::shared_ptr<const StoredMesh>> MeshCatalog::Load(const std::string& sha256) {
  if (std::shared_ptr<const StoredMesh> known = Find(sha256); known != nullptr) return known;
  if (store_ == nullptr) return NoSuchMesh();
  const Arrival arrival(this, sha256);
  absl::StatusOr<MeshRecord> record = store_->Find(sha256);
  if (absl::IsNotFound(record.status())) return NoSuchMesh();
  TF_RETURN_IF_ERROR(record.status());
  TF_ASSIGN_OR_RETURN(
      MemoryReservation reservation,
      budget_->Reserve(PeakBytes({record->shape, record->total_bytes, sha256}), "mesh"));
  // The digest says that it is what was checked when it came.
  TF_ASSIGN_OR_RETURN(MeshPayload payload, store_->Read(sha256));
  TF_ASSIGN_OR_RETURN(TetMesh mesh,
                      TetMesh::Create(std::move(payload.positions()), std::move(payload.tets())));
  std::vector<int32_t> skin = BoundaryVertices(mesh);
  TF_RETURN_IF_ERROR(reservation.Resize(
      record->total_bytes + static_cast<int64_t>(skin.size() * sizeof(int32_t)), "mesh"));
  return Add(std::make_shared<const StoredMesh>(
      StoredMesh{std::move(reservation), sha256, std::move(mesh), std::move(payload.cell_arrays()),
                 std::move(skin)}));
}

std::shared_ptr<const StoredMesh> MeshCatalog::Find(const std::string& sha256) {
  MutexLock lock(mutex_);
  const auto found = meshes_.find(sha256);
  if (found == meshes_.end()) {
    return nullptr;
  }
  found->second.last_used = clock_->Now();
  return found->second.mesh;
}

absl::StatusOr<MeshView> MeshCatalog::Look(const std::string& sha256) {
  std::shared_ptr<const StoredMesh> mesh = Find(sha256);
  if (mesh != nullptr) return MeshView{RecordOf(*mesh), std::move(mesh)};
  if (store_ == nullptr) return NoSuchMesh();
  absl::StatusOr<MeshRecord> record = store_->Find(sha256);
  if (absl::IsNotFound(record.status())) return NoSuchMesh();
  TF_RETURN_IF_ERROR(record.status());
  return MeshView{*std::move(record), nullptr};
}

absl::StatusOr<MeshViewPage> MeshCatalog::List(const std::string& after, int limit) {
  MeshViewPage page;
  if (store_ != nullptr) {
    TF_ASSIGN_OR_RETURN(MeshStore::Page stored, store_->List(after, limit));
    page.next = std::move(stored.next);
    MutexLock lock(mutex_);
    for (MeshRecord& record : stored.records) {
      const auto known = meshes_.find(record.sha256);
      page.views.push_back(
          {std::move(record), known == meshes_.end() ? nullptr : known->second.mesh});
    }
    return page;
  }
  MutexLock lock(mutex_);
  for (auto entry = meshes_.upper_bound(after); entry != meshes_.end(); ++entry) {
    if (page.views.size() == static_cast<size_t>(limit)) {
      page.next = page.views.back().record.sha256;
      break;
    }
    page.views.push_back({RecordOf(*entry->second.mesh), entry->second.mesh});
  }
  return page;
}

absl::Status MeshCatalog::Remove(const std::string& sha256) {
  // From the store first: what fails there is still known.
  if (store_ != nullptr) {
    const absl::Status removed = store_->Delete(sha256);
    if (absl::IsNotFound(removed)) return NoSuchMesh();
    TF_RETURN_IF_ERROR(removed);
  }
  std::shared_ptr<const StoredMesh> removed;  // destroyed after the lock is released
  MutexLock lock(mutex_);
  const auto found = meshes_.find(sha256);
  if (found == meshes_.end()) return store_ == nullptr ? NoSuchMesh() : absl::OkStatus();
  removed = std::move(found->second.mesh);
  meshes_.erase(found);
  return absl::OkStatus();
}

int MeshCatalog::RemoveIdle(Clock::Duration idle) {
  std::vector<std::shared_ptr<const StoredMesh>> removed;  // destroyed after the lock is released
  MutexLock lock(mutex_);
  const Clock::TimePoint cutoff = clock_->Now() - idle;
  for (auto entry = meshes_.begin(); entry != meshes_.end();) {
    // New users come through this map alone: with one reference nobody can gain another now.
    if (entry->second.mesh.use_count() == 1 && entry->second.last_used <= cutoff) {
      removed.push_back(std::move(entry->second.mesh));
      entry = meshes_.erase(entry);
    } else {
      ++entry;
    }
  }
  return static_cast<int>(removed.size());
}

std::vector<std::string> MeshCatalog::UsedSince(Clock::TimePoint since) {
  std::vector<std::string> used;
  MutexLock lock(mutex_);
  for (const auto& [sha256, entry] : meshes_) {
    if (entry.mesh.use_count() > 1 || entry.last_used > since) used.push_back(sha256);
  }
  return used;
}

absl::StatusOr<bool> MeshCatalog::RemoveUnused(const std::string& sha256, Clock::TimePoint since) {
  std::shared_ptr<const StoredMesh> removed;  // destroyed after the lock is released
  {
    MutexLock lock(mutex_);
    if (arriving_.contains(sha256)) return false;
    if (const auto found = meshes_.find(sha256); found != meshes_.end()) {
      if (found->second.mesh.use_count() > 1 || found->second.last_used > since) return false;
      removed = std::move(found->second.mesh);
      meshes_.erase(found);
    }
    removing_ = sha256;
  }
  const absl::Status status = store_->Delete(sha256);
  MutexLock lock(mutex_);
  removing_.clear();
  removed_.NotifyAll();
  if (!status.ok() && !absl::IsNotFound(status)) return status;
  return status.ok();
}

}  // namespace tissueform
