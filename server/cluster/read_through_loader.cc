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

ReadThroughLoader::ReadThroughLoader(PostgresPool* pool)
    : blobs_(pool),
      database_(pool),
      sessions_(&database_, SystemUnixSeconds),
      predictions_(&database_, &blobs_),
      cases_(&database_, &blobs_),
      rows_(&database_) {}

absl::StatusOr<FoundRows> ReadThroughLoader::ReadRow(const RowName& row) {
  FoundRows found;
  TF_RETURN_IF_ERROR(
      Look({.kind = static_cast<int>(row.kind), .name = row.name, .owner = row.owner},
           [&] { return Read(row, &found); }));
  return found;
}

absl::Status ReadThroughLoader::ReadForExport(const std::string& id,
                                              const std::function<absl::Status()>& read) {
  return Look({.kind = kExportKind, .name = id}, [&]() -> absl::Status {
    TF_RETURN_IF_ERROR(read());
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

absl::Status ReadThroughLoader::ReadSession(const std::string& id, FoundRows* found) {
  std::promise<absl::StatusOr<SessionRecord>> answer;
  sessions_.Get(
      id, [&answer](absl::StatusOr<SessionRecord> record) { answer.set_value(std::move(record)); });
  TF_ASSIGN_OR_RETURN(found->session, answer.get_future().get());
  return absl::OkStatus();
}

absl::Status ReadThroughLoader::Read(const RowName& row, FoundRows* found) {
  switch (row.kind) {
    case RowName::Kind::kSession:
      return ReadSession(row.name, found);
    case RowName::Kind::kPrediction: {
      TF_ASSIGN_OR_RETURN(found->prediction, predictions_.Get(row.name));
      return absl::OkStatus();
    }
    case RowName::Kind::kCase: {
      TF_ASSIGN_OR_RETURN(found->of_case, cases_.Find({.sha256 = row.name, .owner = row.owner}));
      return absl::OkStatus();
    }
    case RowName::Kind::kMesh: {
      TF_ASSIGN_OR_RETURN(MeshRight right, rows_.FindMeshRight(row.owner, row.name));
      found->access.mesh_rights = {std::move(right)};
      return absl::OkStatus();
    }
    case RowName::Kind::kLink: {
      TF_ASSIGN_OR_RETURN(FollowLinkRow link, rows_.FindLink(row.name));
      const std::string session = link.session;
      found->access.links = {std::move(link)};
      return ReadSession(session, found);
    }
  }
  return absl::NotFoundError("no such kind");
}

}  // namespace tissueform
