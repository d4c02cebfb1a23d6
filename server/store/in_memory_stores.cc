// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/in_memory_stores.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "server/store/in_memory_case_store.h"
#include "server/store/in_memory_session_store.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

class InMemoryStores final : public Stores {
 public:
  InMemoryStores(UnixClock clock, std::unique_ptr<UploadStore> uploads)
      : sessions_(std::move(clock)), uploads_(std::move(uploads)) {}

  SessionStore& sessions() override { return sessions_; }
  MeshStore& meshes() override { return meshes_; }
  UploadStore& uploads() override { return *uploads_; }
  PredictionStore& predictions() override { return predictions_; }
  CaseStore& cases() override { return cases_; }
  bool keeps() const override { return false; }

 private:
  InMemorySessionStore sessions_;
  InMemoryMeshStore meshes_;
  const std::unique_ptr<UploadStore> uploads_;
  InMemoryPredictionStore predictions_;
  InMemoryCaseStore cases_;
};

}  // namespace

absl::Status InMemoryMeshStore::Put(const MeshRecord& record, const MeshPayloadView& payload) {
  TF_RETURN_IF_ERROR(CheckMeshRecord(record, payload));
  auto bytes = std::make_shared<const std::string>(absl::StrJoin(payload.segments, ""));
  MutexLock lock(mutex_);
  const auto [found, is_new] = meshes_.try_emplace(record.sha256, Mesh{record, std::move(bytes)});
  if (!is_new) {
    int64_t& last_used_s = found->second.record.last_used_s;
    last_used_s = std::max(last_used_s, record.last_used_s);
  }
  return absl::OkStatus();
}

absl::StatusOr<MeshRecord> InMemoryMeshStore::Find(const std::string& sha256) {
  MutexLock lock(mutex_);
  const auto found = meshes_.find(sha256);
  if (found == meshes_.end()) return NoMesh(sha256);
  return found->second.record;
}

absl::StatusOr<MeshPayload> InMemoryMeshStore::Read(const std::string& sha256) {
  Mesh mesh;
  {
    MutexLock lock(mutex_);
    const auto found = meshes_.find(sha256);
    if (found == meshes_.end()) return NoMesh(sha256);
    mesh = found->second;
  }
  MeshPayload payload(mesh.record.shape);
  payload.Write(0, *mesh.bytes);
  return payload;
}

absl::StatusOr<MeshStore::Page> InMemoryMeshStore::List(const std::string& after, int limit) {
  if (limit < 1) return BadLimit(limit);
  Page page;
  MutexLock lock(mutex_);
  for (auto next = meshes_.upper_bound(after); next != meshes_.end(); ++next) {
    if (page.records.size() == static_cast<size_t>(limit)) {
      page.next = page.records.back().sha256;
      break;
    }
    page.records.push_back(next->second.record);
  }
  return page;
}

absl::Status InMemoryMeshStore::Delete(const std::string& sha256) {
  MutexLock lock(mutex_);
  return meshes_.erase(sha256) > 0 ? absl::OkStatus() : NoMesh(sha256);
}

absl::Status InMemoryMeshStore::Touch(const std::vector<std::string>& sha256s, int64_t now_s) {
  MutexLock lock(mutex_);
  for (const std::string& sha256 : sha256s) {
    if (const auto found = meshes_.find(sha256); found != meshes_.end()) {
      int64_t& last_used_s = found->second.record.last_used_s;
      last_used_s = std::max(last_used_s, now_s);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<MeshRecord>> InMemoryMeshStore::ListUnused(int64_t before_s, int limit) {
  if (limit < 1) return BadLimit(limit);
  std::vector<MeshRecord> unused;
  {
    MutexLock lock(mutex_);
    for (const auto& [sha256, mesh] : meshes_) {
      if (mesh.record.last_used_s < before_s) unused.push_back(mesh.record);
    }
  }
  std::stable_sort(unused.begin(), unused.end(), [](const MeshRecord& a, const MeshRecord& b) {
    return a.last_used_s < b.last_used_s;
  });
  if (unused.size() > static_cast<size_t>(limit)) unused.resize(limit);
  return unused;
}

absl::Status InMemoryPredictionStore::Create(const PredictionRecord& record,
                                             const std::string& positions) {
  TF_RETURN_IF_ERROR(CheckPrediction(record, positions));
  MutexLock lock(mutex_);
  if (predictions_.contains(record.id)) return PredictionExists(record.id);
  Prediction prediction{record, positions};
  if (bytes_ + prediction.Bytes() > most_bytes_) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the predictions of a server with --in-memory are limited to ", most_bytes_ >> 20,
        " MiB together; delete some, or run the server with --data-dir"));
  }
  bytes_ += prediction.Bytes();
  predictions_.emplace(record.id, std::move(prediction));
  return absl::OkStatus();
}

absl::StatusOr<PredictionRecord> InMemoryPredictionStore::Get(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = predictions_.find(id);
  if (found == predictions_.end()) return NoPrediction(id);
  return found->second.record;
}

absl::StatusOr<std::string> InMemoryPredictionStore::Positions(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = predictions_.find(id);
  if (found == predictions_.end()) return NoPrediction(id);
  return found->second.positions;
}

absl::StatusOr<PredictionStore::Page> InMemoryPredictionStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  Page page;
  MutexLock lock(mutex_);
  for (auto next = predictions_.upper_bound(request.after); next != predictions_.end(); ++next) {
    const PredictionRecord& record = next->second.record;
    const bool visible = !request.owner.has_value() || record.owner == *request.owner ||
                         request.also.contains(record.id);
    if (!visible) continue;
    if (request.session.has_value() && record.session != *request.session) continue;
    if (request.case_sha256.has_value() && record.case_sha256 != *request.case_sha256) continue;
    if (page.records.size() == static_cast<size_t>(request.limit)) {
      page.next = page.records.back().id;
      break;
    }
    page.records.push_back(record);
  }
  return page;
}

absl::Status InMemoryPredictionStore::Delete(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = predictions_.find(id);
  if (found == predictions_.end()) return NoPrediction(id);
  bytes_ -= found->second.Bytes();
  predictions_.erase(found);
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Stores>> OpenInMemoryStores(UnixClock clock, UploadLimits limits) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<UploadStore> uploads, UploadStore::OpenTemporary(limits));
  return std::make_unique<InMemoryStores>(std::move(clock), std::move(uploads));
}

}  // namespace tissueform
