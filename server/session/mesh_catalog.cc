// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_catalog.h"

#include <algorithm>
#include <utility>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"
#include "server/session/mesh_checks.h"
#include "server/session/session_errors.h"

namespace tissueform {
namespace {

// From here on the reservation is what the mesh itself takes.
absl::StatusOr<std::shared_ptr<const StoredMesh>> MakeStored(MemoryReservation reservation,
                                                             const std::string& sha256,
                                                             TetMesh mesh, MeshPayload* payload) {
  TriangleIndices facets = BoundaryFacets(mesh);
  std::vector<int32_t> skin = VerticesOf(facets);
  std::vector<CellArray> cell_arrays = std::move(payload->cell_arrays());
  const int64_t payload_bytes =
      ViewMeshPayload(mesh.positions(), mesh.tets(), cell_arrays).shape.TotalBytes();
  TF_RETURN_IF_ERROR(reservation.Resize(
      payload_bytes + static_cast<int64_t>((static_cast<size_t>(facets.size()) + skin.size()) *
                                           sizeof(int32_t)),
      "mesh"));
  return std::make_shared<const StoredMesh>(StoredMesh{std::move(reservation), sha256,
                                                       std::move(mesh), std::move(cell_arrays),
                                                       std::move(facets), std::move(skin)});
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
    while (catalog_->removing_.contains(sha256_)) catalog_->moved_.Wait(catalog_->mutex_);
    catalog_->arriving_.insert(sha256_);
  }
  ~Arrival() {
    MutexLock lock(catalog_->mutex_);
    catalog_->arriving_.erase(catalog_->arriving_.find(sha256_));
    catalog_->moved_.NotifyAll();
  }
  Arrival(const Arrival&) = delete;
  Arrival& operator=(const Arrival&) = delete;

 private:
  MeshCatalog* const catalog_;
  const std::string sha256_;
};

absl::Status MeshCatalog::Check(const UploadAnnouncement& announced) const {
  return CheckAnnouncedMesh(announced, limits_);
}

absl::StatusOr<std::shared_ptr<const StoredMesh>> MeshCatalog::Admit(
    const UploadAnnouncement& announced, const ReadPayload& read) {
  TF_ASSIGN_OR_RETURN(MemoryReservation reservation,
                      budget_->Reserve(PeakBytes(announced.shape), "mesh"));
  TF_ASSIGN_OR_RETURN(MeshPayload payload, read());
  TF_ASSIGN_OR_RETURN(TetMesh mesh, CheckArrivedMesh(announced.sha256, &payload));
  TF_ASSIGN_OR_RETURN(
      std::shared_ptr<const StoredMesh> stored,
      MakeStored(std::move(reservation), announced.sha256, std::move(mesh), &payload));

  const Arrival arrival(this, announced.sha256);
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
  TF_ASSIGN_OR_RETURN(MemoryReservation reservation,
                      budget_->Reserve(PeakBytes(record->shape), "mesh"));
  // The digest says that it is what was checked when it came.
  TF_ASSIGN_OR_RETURN(MeshPayload payload, store_->Read(sha256));
  TF_ASSIGN_OR_RETURN(TetMesh mesh,
                      TetMesh::Create(std::move(payload.positions()), std::move(payload.tets())));
  TF_ASSIGN_OR_RETURN(std::shared_ptr<const StoredMesh> stored,
                      MakeStored(std::move(reservation), sha256, std::move(mesh), &payload));
  return Add(std::move(stored));
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
  {
    MutexLock lock(mutex_);
    while (removing_.contains(sha256)) moved_.Wait(mutex_);
    removing_.insert(sha256);
    // A thread that has read it, or has put it into the store, would otherwise give it to later
    // callers after it was removed.
    while (arriving_.contains(sha256)) moved_.Wait(mutex_);
  }
  return FinishRemoval(sha256);
}

absl::Status MeshCatalog::FinishRemoval(const std::string& sha256) {
  // From the store first: what fails there is still known.
  const absl::Status status = store_ == nullptr ? NoSuchMesh() : store_->Delete(sha256);
  std::shared_ptr<const StoredMesh> removed;  // destroyed after the lock is released
  if (status.ok() || absl::IsNotFound(status)) {
    MutexLock lock(mutex_);
    if (const auto found = meshes_.find(sha256); found != meshes_.end()) {
      removed = std::move(found->second.mesh);
      meshes_.erase(found);
    }
  }
  const bool is_gone = status.ok() || removed != nullptr;
  // Before it may arrive again.
  if (is_gone) on_removed_(sha256);
  {
    MutexLock lock(mutex_);
    removing_.erase(sha256);
    moved_.NotifyAll();
  }
  if (is_gone) return absl::OkStatus();
  return absl::IsNotFound(status) ? NoSuchMesh() : status;
}

int MeshCatalog::RemoveIdle(Clock::Duration idle) {
  std::vector<std::shared_ptr<const StoredMesh>> removed;  // destroyed after the lock is released
  {
    MutexLock lock(mutex_);
    const Clock::TimePoint cutoff = clock_->Now() - idle;
    for (auto entry = meshes_.begin(); entry != meshes_.end();) {
      // New users come through this map only: a mesh with one reference cannot gain another now.
      if (entry->second.mesh.use_count() == 1 && entry->second.last_used <= cutoff) {
        removed.push_back(std::move(entry->second.mesh));
        entry = meshes_.erase(entry);
      } else {
        ++entry;
      }
    }
  }
  if (store_ == nullptr) {
    for (const auto& mesh : removed) on_removed_(mesh->sha256);
  }
  return static_cast<int>(removed.size());
}

MeshCatalog::Held MeshCatalog::CountHeld() const {
  MutexLock lock(mutex_);
  Held held;
  for (const auto& [sha256, entry] : meshes_) {
    ++held.meshes;
    held.bytes += entry.mesh->reservation.bytes();
  }
  return held;
}

void MeshCatalog::Forget(const std::string& sha256) {
  std::shared_ptr<const StoredMesh> forgotten;  // destroyed after the lock is released
  MutexLock lock(mutex_);
  const auto found = meshes_.find(sha256);
  if (found == meshes_.end()) return;
  forgotten = std::move(found->second.mesh);
  meshes_.erase(found);
}

std::vector<std::string> MeshCatalog::HeldNames() const {
  std::vector<std::string> names;
  MutexLock lock(mutex_);
  for (const auto& [sha256, entry] : meshes_) names.push_back(sha256);
  return names;
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
    if (arriving_.contains(sha256) || removing_.contains(sha256)) return false;
    if (const auto found = meshes_.find(sha256); found != meshes_.end()) {
      if (found->second.mesh.use_count() > 1 || found->second.last_used > since) return false;
      removed = std::move(found->second.mesh);
      meshes_.erase(found);
    }
    removing_.insert(sha256);
  }
  const absl::Status status = FinishRemoval(sha256);
  if (!status.ok() && !absl::IsNotFound(status)) return status;
  return status.ok();
}

}  // namespace tissueform
