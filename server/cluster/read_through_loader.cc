// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/read_through_loader.h"

#include <future>
#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kExportKind = -1;
constexpr size_t kMaxRemembered = 10'000;

}  // namespace

ReadThroughLoader::ReadThroughLoader(PostgresPool* pool, AccessChanges* access,
                                     ExportQueue* exports)
    : access_(*access),
      exports_(*exports),
      sessions_(pool, SystemUnixSeconds),
      predictions_(pool),
      cases_(pool),
      rows_(pool) {}

absl::Status ReadThroughLoader::FetchIfMissing(const Access::Unknown& what) {
  return Look({.kind = static_cast<int>(what.kind), .name = what.name, .owner = what.owner},
              [&] { return Read(what); });
}

absl::Status ReadThroughLoader::LookForExport(const std::string& id) {
  return Look({.kind = kExportKind, .name = id}, [&]() -> absl::Status {
    TF_RETURN_IF_ERROR(exports_.ReloadRows());
    return absl::NotFoundError("");  // not again at once, whatever it has found
  });
}

int64_t ReadThroughLoader::lookups() const {
  MutexLock lock(mutex_);
  return lookups_;
}

absl::StatusOr<bool> ReadThroughLoader::Begin(const Key& key) {
  const auto now = std::chrono::steady_clock::now();
  MutexLock lock(mutex_);
  const auto missing = missing_.find(key);
  if (missing != missing_.end() && now < missing->second) return false;
  while (reading_ >= kMaxAtOnce && now >= silent_until_) {
    if (!place_.WaitUntil(mutex_, now + kPatience) && reading_ >= kMaxAtOnce) break;
  }
  if (reading_ >= kMaxAtOnce || now < silent_until_) {
    return absl::UnavailableError(
        "the resource is unknown here, and the database does not answer; try again");
  }
  if (missing_.size() >= kMaxRemembered) missing_.clear();
  ++reading_;
  ++lookups_;
  return true;
}

absl::Status ReadThroughLoader::Look(const Key& key, const std::function<absl::Status()>& read) {
  TF_ASSIGN_OR_RETURN(const bool begun, Begin(key));
  if (!begun) return absl::OkStatus();
  const absl::Status status = read();
  const auto until = std::chrono::steady_clock::now() + kRemembered;
  MutexLock lock(mutex_);
  --reading_;
  place_.NotifyAll();
  if (absl::IsUnavailable(status)) {
    silent_until_ = until;
    return status;
  }
  if (status.ok()) {
    missing_.erase(key);
  } else {
    missing_[key] = until;
  }
  return absl::OkStatus();
}

absl::Status ReadThroughLoader::ReadSession(const std::string& id) {
  std::promise<absl::StatusOr<SessionRecord>> answer;
  sessions_.Get(
      id, [&answer](absl::StatusOr<SessionRecord> record) { answer.set_value(std::move(record)); });
  TF_ASSIGN_OR_RETURN(const SessionRecord record, answer.get_future().get());
  access_.Added(record);
  return absl::OkStatus();
}

absl::Status ReadThroughLoader::Read(const Access::Unknown& what) {
  switch (what.kind) {
    case Access::Unknown::Kind::kSession:
      return ReadSession(what.name);
    case Access::Unknown::Kind::kPrediction: {
      TF_ASSIGN_OR_RETURN(const PredictionRecord record, predictions_.Get(what.name));
      access_.Added(record);
      return absl::OkStatus();
    }
    case Access::Unknown::Kind::kCase: {
      TF_ASSIGN_OR_RETURN(const CaseRecord record,
                          cases_.Find({.sha256 = what.name, .owner = what.owner}));
      access_.Added(record);
      return absl::OkStatus();
    }
    case Access::Unknown::Kind::kMesh: {
      TF_ASSIGN_OR_RETURN(const MeshRight right, rows_.FindMeshRight(what.owner, what.name));
      access_.OnRemoteChange({.mesh_rights = {right}});
      return absl::OkStatus();
    }
    case Access::Unknown::Kind::kLink: {
      TF_ASSIGN_OR_RETURN(const FollowLinkRow link, rows_.FindLink(what.name));
      access_.OnRemoteChange({.links = {link}});
      return ReadSession(link.session);
    }
  }
  return absl::NotFoundError("no such kind");
}

}  // namespace tissueform
