// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access_changes.h"

#include <future>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "server/access/access_names.h"
#include "server/session/session_errors.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

void WarnUnlessErased(const absl::Status& status) {
  // In memory it is away; after a restart it belongs to a resource that is not there.
  if (!status.ok()) spdlog::warn("access rights of a removed resource remain on disk");
}

absl::Status TooMany(absl::string_view what, int limit, absl::string_view option) {
  return absl::ResourceExhaustedError(absl::StrCat(
      "it has ", limit, " ", what, ", which is the limit; revoke some or raise ", option));
}

}  // namespace

absl::Status AccessChanges::LoadAll() {
  TF_ASSIGN_OR_RETURN(const AccessRows rows, store_->Load());
  MutexLock lock(access_.mutex_);
  access_.table_.Add(rows);
  return absl::OkStatus();
}

absl::Status AccessChanges::ReloadRows() {
  MutexLock learning(learning_);
  {
    MutexLock lock(access_.mutex_);
    std::erase_if(unseen_, [](const auto& unseen) { return unseen->ended; });
    access_.fetched_ = {};
  }
  TF_ASSIGN_OR_RETURN(const AccessRows rows, store_->Load());
  {
    ShareTable table;
    table.Add(rows);
    MutexLock lock(access_.mutex_);
    table.Add(access_.fetched_);
    for (const auto& unseen : unseen_) {
      table.Remove(unseen->erased);
      if (unseen->kept) table.Add(unseen->put);
    }
    access_.table_ = std::move(table);
  }
  return absl::OkStatus();
}

void AccessChanges::SessionGone(const std::string& id) {
  AccessRows rows;
  {
    MutexLock lock(access_.mutex_);
    const ResourceIndex::Session* session = access_.index_.FindSession(id);
    if (session != nullptr)
      rows.shares = access_.table_.SharesOf(session->owner, SessionResource(id));
    rows.links = access_.table_.LinksOf(id);
    access_.index_.RemoveSession(id);
  }
  Erase(std::move(rows), WarnUnlessErased);
}

void AccessChanges::PredictionGone(const std::string& id) {
  MutexLock lock(access_.mutex_);
  access_.index_.RemovePrediction(id);
}

void AccessChanges::CaseGone(const CaseKey& key) {
  MutexLock lock(access_.mutex_);
  access_.index_.RemoveCase(key);
}

AccessChanges::Known AccessChanges::AllKnown() const {
  Known known;
  MutexLock lock(access_.mutex_);
  for (const auto& [id, session] : access_.index_.sessions()) known.sessions.push_back(id);
  for (const auto& [id, prediction] : access_.index_.predictions()) known.predictions.push_back(id);
  for (const auto& [key, of_case] : access_.index_.cases()) known.cases.push_back(key);
  return known;
}

std::shared_ptr<AccessChanges::Unseen> AccessChanges::Begin(AccessRows erased, AccessRows put) {
  auto unseen = std::make_shared<Unseen>();
  unseen->erased = std::move(erased);
  unseen->put = std::move(put);
  if (follows_) unseen_.push_back(unseen);
  return unseen;
}

void AccessChanges::End(Unseen* unseen, bool kept) {
  AccessRows of_nothing;
  {
    MutexLock lock(access_.mutex_);
    unseen->ended = true;
    unseen->kept = kept;
    if (!kept) return;
    access_.table_.Add(unseen->put);
    for (const FollowLinkRow& link : unseen->put.links) {
      if (access_.index_.FindSession(link.session) == nullptr) of_nothing.links.push_back(link);
    }
  }
  // Its session went while it was put there: it must not open the next one of that name.
  Erase(std::move(of_nothing), WarnUnlessErased);
}

absl::Status AccessChanges::FetchIfMissing(const Principal& caller,
                                           absl::string_view resource) const {
  using Kind = RowName::Kind;
  if (absl::ConsumePrefix(&resource, kSessionsPrefix)) {
    return access_.FetchIfMissing(Kind::kSession, std::string(resource));
  }
  if (absl::ConsumePrefix(&resource, kPredictionsPrefix)) {
    return access_.FetchIfMissing(Kind::kPrediction, std::string(resource));
  }
  if (absl::ConsumePrefix(&resource, kCasesPrefix)) {
    return access_.FetchIfMissing(Kind::kCase, std::string(resource), caller.name);
  }
  return absl::OkStatus();
}

absl::Status AccessChanges::MayOwn(const Principal& caller, const std::string& resource) const {
  absl::string_view name = resource;
  if (absl::ConsumePrefix(&name, kProjectsPrefix)) return CheckAccessName(name, "project");
  TF_RETURN_IF_ERROR(CheckAccessName(resource, "resource"));
  if (absl::ConsumePrefix(&name, kSessionsPrefix)) {
    const std::string id(name);
    if (access_.index_.FindSession(id) == nullptr) return NoSuchSession(id);
    return Access::Judge(access_.SessionLevel(caller, id), Permission::kOwner, NoSuchSession(id));
  }
  if (absl::ConsumePrefix(&name, kPredictionsPrefix)) {
    const std::string id(name);
    if (access_.index_.FindPrediction(id) == nullptr) return NoPrediction(id);
    return Access::Judge(access_.PredictionLevel(caller, id), Permission::kOwner, NoPrediction(id));
  }
  if (absl::ConsumePrefix(&name, kCasesPrefix)) {
    const std::string sha256(name);
    TF_ASSIGN_OR_RETURN(const CaseKey key, access_.FindCase(caller, sha256, Permission::kOwner));
    return access_.index_.FindCase(key) == nullptr ? NoCase(sha256) : absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "this resource cannot be shared; name a session, a prediction, a case or a "
      "project, \"sessions/{id}\"");
}

absl::Status AccessChanges::CheckShare(const Principal& caller, const ShareRow& share) const {
  TF_RETURN_IF_ERROR(CheckAccessName(share.principal, "principal"));
  TF_RETURN_IF_ERROR(FetchIfMissing(caller, share.resource));
  MutexLock lock(access_.mutex_);
  TF_RETURN_IF_ERROR(MayOwn(caller, share.resource));
  const bool is_new =
      !access_.table_.RoleOf(caller.name, share.resource, share.principal).has_value();
  const size_t most = static_cast<size_t>(options_.max_shares_per_resource);
  if (is_new && access_.table_.SharesOf(caller.name, share.resource).size() >= most) {
    return TooMany("shares", options_.max_shares_per_resource, "--max-shares-per-resource");
  }
  return absl::OkStatus();
}

void AccessChanges::Share(const Principal& caller, ShareRow share, const Done& done) {
  if (const absl::Status status = CheckShare(caller, share); !status.ok()) {
    done(status);
    return;
  }
  share.owner = caller.name;
  Put({.shares = {std::move(share)}}, done);
}

void AccessChanges::Unshare(const Principal& caller, const std::string& resource,
                            const std::string& with, const Done& done) {
  absl::Status status = FetchIfMissing(caller, resource);
  if (status.ok()) {
    MutexLock lock(access_.mutex_);
    status = MayOwn(caller, resource);
    if (status.ok() && !access_.table_.RoleOf(caller.name, resource, with).has_value()) {
      status = absl::NotFoundError("no such share; ListShares lists them");
    }
  }
  if (!status.ok()) {
    done(status);
    return;
  }
  Erase({.shares = {{.resource = resource, .owner = caller.name, .principal = with}}}, done);
}

absl::StatusOr<std::vector<ShareRow>> AccessChanges::SharesOf(const Principal& caller,
                                                              const std::string& resource) const {
  TF_RETURN_IF_ERROR(FetchIfMissing(caller, resource));
  MutexLock lock(access_.mutex_);
  TF_RETURN_IF_ERROR(MayOwn(caller, resource));
  return access_.table_.SharesOf(caller.name, resource);
}

absl::Status AccessChanges::CheckLink(const Principal& caller, const FollowLinkRow& link) const {
  TF_RETURN_IF_ERROR(FetchIfMissing(caller, SessionResource(link.session)));
  if (!link.case_sha256.empty()) {
    TF_RETURN_IF_ERROR(FetchIfMissing(caller, CaseResource(link.case_sha256)));
  }
  MutexLock lock(access_.mutex_);
  if (access_.index_.FindSession(link.session) == nullptr) return NoSuchSession(link.session);
  TF_RETURN_IF_ERROR(Access::Judge(access_.SessionLevel(caller, link.session), Permission::kWrite,
                                   NoSuchSession(link.session)));
  if (!link.case_sha256.empty()) {
    TF_ASSIGN_OR_RETURN(const CaseKey key,
                        access_.FindCase(caller, link.case_sha256, Permission::kRead));
    if (access_.index_.FindCase(key) == nullptr) return NoCase(key.sha256);
  }
  if (access_.table_.LinksOf(link.session).size() >=
      static_cast<size_t>(options_.max_links_per_session)) {
    return TooMany("follow links", options_.max_links_per_session, "--max-links-per-session");
  }
  return absl::OkStatus();
}

void AccessChanges::AddLink(const Principal& caller, FollowLinkRow link, const Done& done) {
  AccessRows ended;
  {
    MutexLock lock(access_.mutex_);
    ended.links = access_.table_.LinksUntil(access_.clock_());
  }
  if (!ended.links.empty()) Erase(std::move(ended), WarnUnlessErased);
  if (const absl::Status status = CheckLink(caller, link); !status.ok()) {
    done(status);
    return;
  }
  link.maker = caller.name;
  Put({.links = {std::move(link)}}, done);
}

void AccessChanges::RemoveLinks(const Principal& caller, const std::string& session,
                                const Done& done) {
  if (const absl::Status status = access_.CheckSessionAccess(caller, session, Permission::kWrite);
      !status.ok()) {
    done(status);
    return;
  }
  AccessRows rows;
  {
    MutexLock lock(access_.mutex_);
    if (access_.index_.FindSession(session) != nullptr) {
      rows.links = access_.table_.LinksOf(session);
    }
  }
  Erase(std::move(rows), done);
}

absl::Status AccessChanges::GrantMesh(const Principal& caller, const std::string& sha256,
                                      int64_t bytes) {
  // What nobody with a name has is open to those without one as it is.
  if (access_.CheckMeshAccess(caller, sha256, Permission::kOwner).ok()) return absl::OkStatus();
  std::promise<absl::Status> kept;
  Put({.mesh_rights = {{.principal = caller.name, .sha256 = sha256, .bytes = bytes}}},
      [&kept](const absl::Status& status) { kept.set_value(status); });
  return kept.get_future().get();
}

absl::Status AccessChanges::ReleaseMesh(const Principal& caller, const std::string& sha256) {
  std::promise<absl::Status> erased;
  Erase({.mesh_rights = {{.principal = caller.name, .sha256 = sha256}}},
        [&erased](const absl::Status& status) { erased.set_value(status); });
  return erased.get_future().get();
}

void AccessChanges::SessionRemoved(const std::string& id) {
  {
    MutexLock lock(access_.mutex_);
    if (access_.index_.FindSession(id) == nullptr) return;
  }
  SessionGone(id);
}

void AccessChanges::PredictionRemoved(const std::string& id) {
  AccessRows rows;
  {
    MutexLock lock(access_.mutex_);
    const ResourceIndex::Prediction* prediction = access_.index_.FindPrediction(id);
    if (prediction == nullptr) return;
    rows.shares = access_.table_.SharesOf(prediction->owner, PredictionResource(id));
    access_.index_.RemovePrediction(id);
  }
  Erase(std::move(rows), WarnUnlessErased);
}

void AccessChanges::CaseRemoved(const CaseKey& key) {
  AccessRows rows;
  {
    MutexLock lock(access_.mutex_);
    rows.shares = access_.table_.SharesOf(key.owner, CaseResource(key.sha256));
    access_.index_.RemoveCase(key);
  }
  Erase(std::move(rows), WarnUnlessErased);
}

void AccessChanges::MeshRemoved(const std::string& sha256) {
  AccessRows rows;
  {
    MutexLock lock(access_.mutex_);
    for (const auto& [holder, bytes] : access_.table_.HoldersOf(sha256)) {
      rows.mesh_rights.push_back({.principal = holder, .sha256 = sha256});
    }
  }
  Erase(std::move(rows), WarnUnlessErased);
}

void AccessChanges::Erase(AccessRows rows, const Done& done) {
  if (rows.shares.empty() && rows.links.empty() && rows.mesh_rights.empty()) {
    done(absl::OkStatus());
    return;
  }
  std::shared_ptr<Unseen> unseen;
  {
    MutexLock lock(access_.mutex_);
    access_.table_.Remove(rows);
    unseen = Begin(rows, {});
  }
  store_->Change(std::move(rows), {}, [this, unseen, done](const absl::Status& status) {
    End(unseen.get(), false);
    done(status);
  });
}

void AccessChanges::Put(AccessRows rows, const Done& done) {
  std::shared_ptr<Unseen> unseen;
  {
    MutexLock lock(access_.mutex_);
    unseen = Begin({}, rows);
  }
  store_->Change({}, std::move(rows), [this, unseen, done](const absl::Status& status) {
    End(unseen.get(), status.ok());
    done(status);
  });
}

}  // namespace tissueform
