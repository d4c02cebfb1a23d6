// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "server/access/access_names.h"
#include "server/session/quotas.h"
#include "server/session/session_errors.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// What the page of who follows calls: its session, what it shows and its case.
constexpr std::array<std::string_view, 9> kOpenToLinks = {
    "AccessService.WhoAmI",      "CaseService.GetCase",
    "CaseService.ReadCase",      "DeformService.AcknowledgeWatch",
    "DeformService.Watch",       "MeshService.GetMesh",
    "MeshService.GetSurface",    "ServerInfoService.GetServerInfo",
    "SessionService.GetSession",
};

bool IsBridge(const Principal& caller) { return caller.roles.contains("bridge"); }
bool IsLink(const Principal& caller) { return !caller.only_session.empty(); }

void Append(const AccessRows& rows, AccessRows* all) {
  all->shares.insert(all->shares.end(), rows.shares.begin(), rows.shares.end());
  all->links.insert(all->links.end(), rows.links.begin(), rows.links.end());
  all->mesh_rights.insert(all->mesh_rights.end(), rows.mesh_rights.begin(), rows.mesh_rights.end());
}

absl::Status LinkHasEnded() {
  return absl::UnauthenticatedError(
      "the follow link has expired or was revoked; ask its sender for a new one");
}

}  // namespace

absl::Status Access::CheckMethodAccess(const Principal& caller, std::string_view method) {
  if (IsLink(caller) && std::ranges::find(kOpenToLinks, method) == kOpenToLinks.end()) {
    return absl::PermissionDeniedError("a follow link can only watch its session; log in for this");
  }
  if (method == "CaseService.UploadCase" && !caller.anonymous() &&
      !caller.roles.contains("publisher")) {
    return absl::PermissionDeniedError(
        "uploading cases requires the role publisher, which the token lacks; ask the "
        "server's operator");
  }
  if (method == "ExportService.UpdateExport" && !caller.anonymous() && !IsBridge(caller)) {
    return absl::PermissionDeniedError(
        "updating exports requires the role bridge, which the token lacks; withdraw the export "
        "instead");
  }
  return absl::OkStatus();
}

absl::Status Access::CheckProjectAccess(const Principal& caller, const std::string& project) {
  if (project.empty()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(CheckAccessName(project, "project"));
  if (caller.anonymous() || caller.projects.contains(project)) return absl::OkStatus();
  return absl::PermissionDeniedError(
      "the token does not include this project; remove it, or request a token that includes it");
}

absl::Status Access::Judge(Level level, Permission need, const absl::Status& not_found) {
  if (level == Level::kNothing) return not_found;
  if (need == Permission::kWrite && level < Level::kWrite) {
    return absl::PermissionDeniedError(
        "it is shared with you read-only; ask its owner for the role planner");
  }
  if (need == Permission::kOwner && level < Level::kOwner) {
    return absl::PermissionDeniedError("only the owner may do this; ask the owner");
  }
  return absl::OkStatus();
}

Access::Level Access::LevelOfShare(const std::string& owner, const std::string& resource,
                                   const std::string& project, const std::string& principal) const {
  std::optional<ShareRole> role = table_.RoleOf(owner, resource, principal);
  if (!project.empty()) {
    role = std::max(role, table_.RoleOf(owner, ProjectResource(project), principal));
  }
  if (!role.has_value()) return Level::kNothing;
  return *role == ShareRole::kPlanner ? Level::kWrite : Level::kRead;
}

Access::Level Access::SessionLevel(const Principal& caller, const std::string& id) const {
  const ResourceIndex::Session* session = index_.FindSession(id);
  if (session == nullptr) return caller.anonymous() ? Level::kOwner : Level::kNothing;
  const std::string resource = SessionResource(id);
  if (IsLink(caller)) {
    return caller.only_session == resource && HasGoodLink(id) ? Level::kRead : Level::kNothing;
  }
  if (session->owner == caller.name) return Level::kOwner;
  return LevelOfShare(session->owner, resource, session->project, caller.name);
}

Access::Level Access::PredictionLevel(const Principal& caller, const std::string& id) const {
  const ResourceIndex::Prediction* prediction = index_.FindPrediction(id);
  if (prediction == nullptr) return caller.anonymous() ? Level::kOwner : Level::kNothing;
  if (IsLink(caller)) return Level::kNothing;
  if (prediction->owner == caller.name) return Level::kOwner;
  if (table_.RoleOf(prediction->owner, PredictionResource(id), caller.name).has_value()) {
    return Level::kRead;
  }
  if (IsBridge(caller) && exports_ != nullptr && exports_->IsExported(id)) return Level::kRead;
  // Only of one owner: an id of a session may have become another's meanwhile.
  const ResourceIndex::Session* session = index_.FindSession(prediction->session);
  if (session == nullptr || session->owner != prediction->owner) return Level::kNothing;
  return std::min(Level::kRead, SessionLevel(caller, prediction->session));
}

bool Access::IsExportedCase(const CaseKey& key) const {
  if (exports_ == nullptr) return false;
  for (const std::string& id : exports_->ExportedOfCase(key.sha256)) {
    const ResourceIndex::Prediction* prediction = index_.FindPrediction(id);
    if (prediction == nullptr) continue;
    // Whoever names a case that is not open to them opens it to no bridge.
    const Principal planner{.name = prediction->owner};
    if (CaseLevel(planner, key) >= Level::kRead) return true;
  }
  return false;
}

Access::Level Access::CaseLevel(const Principal& caller, const CaseKey& key) const {
  if (key.owner == caller.name) return Level::kOwner;
  const ResourceIndex::Case* found = index_.FindCase(key);
  if (found == nullptr) return Level::kNothing;
  if (IsBridge(caller) && IsExportedCase(key)) return Level::kRead;
  return std::min(Level::kRead,
                  LevelOfShare(key.owner, CaseResource(key.sha256), found->project, caller.name));
}

Access::Level Access::MeshLevel(const Principal& caller, const std::string& sha256) const {
  const ShareTable::Holders& holders = table_.HoldersOf(sha256);
  const bool unclaimed = caller.anonymous() && holders.empty();
  if (!IsLink(caller) && (unclaimed || holders.contains(caller.name))) return Level::kOwner;
  for (const std::string& id : index_.SessionsOf(sha256)) {
    if (SessionLevel(caller, id) >= Level::kRead) return Level::kRead;
  }
  for (const std::string& id : index_.PredictionsOf(sha256)) {
    if (PredictionLevel(caller, id) >= Level::kRead) return Level::kRead;
  }
  return Level::kNothing;
}

bool Access::Knows(const RowName& row) const {
  switch (row.kind) {
    case RowName::Kind::kSession:
      return index_.FindSession(row.name) != nullptr;
    case RowName::Kind::kPrediction:
      return index_.FindPrediction(row.name) != nullptr;
    case RowName::Kind::kCase:
      return index_.FindCase({.sha256 = row.name, .owner = row.owner}) != nullptr;
    case RowName::Kind::kMesh:
      return table_.HasMesh(row.owner, row.name);
    case RowName::Kind::kLink:
      return table_.FindLink(row.name) != nullptr;
  }
  return true;
}

absl::Status Access::FetchIfMissing(RowName::Kind kind, const std::string& name,
                                    const std::string& owner) const {
  if (reader_ == nullptr) return absl::OkStatus();
  const RowName row = {.kind = kind, .name = name, .owner = owner};
  {
    MutexLock lock(mutex_);
    if (Knows(row)) return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(const FoundRows found, reader_->ReadRow(row));
  MutexLock lock(mutex_);
  if (found.session.has_value()) index_.Add(*found.session);
  if (found.prediction.has_value()) index_.Add(*found.prediction);
  if (found.of_case.has_value()) index_.Add(*found.of_case);
  table_.Add(found.access);
  Append(found.access, &fetched_);
  return absl::OkStatus();
}

absl::Status Access::CheckSessionAccess(const Principal& caller, const std::string& id,
                                        Permission need) const {
  TF_RETURN_IF_ERROR(FetchIfMissing(RowName::Kind::kSession, id));
  MutexLock lock(mutex_);
  return JudgeSession(caller, id, need);
}

absl::Status Access::RecheckSessionAccess(const Principal& caller, const std::string& id,
                                          Permission need) const {
  MutexLock lock(mutex_);
  if (index_.FindSession(id) == nullptr) return absl::OkStatus();
  return JudgeSession(caller, id, need);
}

absl::Status Access::JudgeSession(const Principal& caller, const std::string& id,
                                  Permission need) const {
  if (caller.only_session == SessionResource(id) && !HasGoodLink(id)) return LinkHasEnded();
  return Judge(SessionLevel(caller, id), need, NoSuchSession(id));
}

absl::Status Access::CheckPredictionAccess(const Principal& caller, const std::string& id,
                                           Permission need) const {
  TF_RETURN_IF_ERROR(FetchIfMissing(RowName::Kind::kPrediction, id));
  MutexLock lock(mutex_);
  return Judge(PredictionLevel(caller, id), need, NoPrediction(id));
}

absl::StatusOr<CaseKey> Access::CheckCaseAccess(const Principal& caller, const std::string& sha256,
                                                Permission need) const {
  const auto found = [&] {
    MutexLock lock(mutex_);
    return IsLink(caller) ? CaseOfLink(caller, sha256) : FindCase(caller, sha256, need);
  };
  absl::StatusOr<CaseKey> first = found();
  if (first.ok() || IsLink(caller)) return first;
  TF_RETURN_IF_ERROR(FetchIfMissing(RowName::Kind::kCase, sha256, caller.name));
  return found();
}

absl::StatusOr<CaseKey> Access::FindCase(const Principal& caller, const std::string& sha256,
                                         Permission need) const {
  CaseKey own{.sha256 = sha256, .owner = caller.name};
  if (caller.anonymous() || index_.FindCase(own) != nullptr) return own;
  const auto& cases = index_.cases();
  for (auto next = cases.lower_bound({.sha256 = sha256});
       next != cases.end() && next->first.sha256 == sha256; ++next) {
    const Level level = CaseLevel(caller, next->first);
    if (level == Level::kNothing) continue;
    TF_RETURN_IF_ERROR(Judge(level, need, NoCase(sha256)));
    return next->first;
  }
  return NoCase(sha256);
}

absl::StatusOr<CaseKey> Access::CaseOfLink(const Principal& link, const std::string& sha256) const {
  const std::string session(absl::StripPrefix(link.only_session, kSessionsPrefix));
  if (!HasGoodLink(session)) return LinkHasEnded();
  for (const FollowLinkRow& row : table_.LinksOf(session)) {
    if (row.case_sha256 != sha256 || !IsGood(row)) continue;
    absl::StatusOr<CaseKey> found =
        FindCase(Principal{.name = row.maker}, sha256, Permission::kRead);
    if (found.ok()) return found;
  }
  return NoCase(sha256);
}

std::optional<std::string> Access::ExportsSeenBy(const Principal& caller) {
  if (IsBridge(caller)) return std::nullopt;
  return caller.name;
}

absl::Status Access::CheckExportAccess(const Principal& caller, const std::string& owner,
                                       const absl::Status& not_found, Permission need) {
  const Level level = owner == caller.name ? Level::kOwner
                      : IsBridge(caller)   ? Level::kRead
                                           : Level::kNothing;
  return Judge(level, need, not_found);
}

absl::Status Access::CheckMeshAccess(const Principal& caller, const std::string& sha256,
                                     Permission need) const {
  const auto judged = [&] {
    MutexLock lock(mutex_);
    return Judge(MeshLevel(caller, sha256), need, NoSuchMesh());
  };
  const absl::Status first = judged();
  if (first.ok() || IsLink(caller)) return first;
  TF_RETURN_IF_ERROR(FetchIfMissing(RowName::Kind::kMesh, sha256, caller.name));
  return judged();
}

bool Access::OthersHoldMesh(const Principal& caller, const std::string& sha256) const {
  MutexLock lock(mutex_);
  const ShareTable::Holders& holders = table_.HoldersOf(sha256);
  if (holders.size() > (holders.contains(caller.name) ? 1U : 0U)) return true;
  for (const std::string& id : index_.SessionsOf(sha256)) {
    if (index_.FindSession(id)->owner != caller.name) return true;
  }
  return false;
}

int Access::CountSessionsOf(const Principal& caller, const std::string& mesh) const {
  MutexLock lock(mutex_);
  int count = 0;
  for (const std::string& id : index_.SessionsOf(mesh)) {
    count += index_.FindSession(id)->owner == caller.name ? 1 : 0;
  }
  return count;
}

absl::StatusOr<std::set<std::string>> Access::SharedSessions(const Principal& caller) const {
  return queries_.SharedSessions(caller.name);
}

absl::StatusOr<std::set<std::string>> Access::SharedPredictions(const Principal& caller) const {
  TF_ASSIGN_OR_RETURN(std::set<std::string> shared, queries_.SharedPredictions(caller.name));
  if (IsBridge(caller) && exports_ != nullptr) shared.merge(exports_->Exported());
  return shared;
}

absl::StatusOr<std::set<CaseKey>> Access::ExportedCases() const {
  std::set<CaseKey> exported;
  for (const std::string& sha256 : exports_->ExportedCases()) {
    TF_ASSIGN_OR_RETURN(const std::vector<CaseGrant> cases, queries_.FindCases(sha256, ""));
    MutexLock lock(mutex_);
    for (const CaseGrant& found : cases) {
      if (IsExportedCase(found.key)) exported.insert(found.key);
    }
  }
  return exported;
}

absl::StatusOr<std::set<CaseKey>> Access::SharedCases(const Principal& caller) const {
  TF_ASSIGN_OR_RETURN(std::set<CaseKey> open, queries_.SharedCases(caller.name));
  if (IsBridge(caller) && exports_ != nullptr) {
    TF_ASSIGN_OR_RETURN(std::set<CaseKey> exported, ExportedCases());
    open.merge(exported);
  }
  std::set<CaseKey> shared;
  std::string last;
  for (const CaseKey& key : open) {
    if (key.sha256 == std::exchange(last, key.sha256)) continue;
    TF_ASSIGN_OR_RETURN(const std::vector<CaseGrant> all,
                        queries_.FindCases(key.sha256, caller.name));
    const CaseKey own = {.sha256 = key.sha256, .owner = caller.name};
    if (std::ranges::find(all, own, &CaseGrant::key) == all.end()) shared.insert(key);
  }
  return shared;
}

bool Access::IsGood(const FollowLinkRow& link) const {
  return link.expires_s > clock_() && index_.FindSession(link.session) != nullptr &&
         SessionLevel(Principal{.name = link.maker}, link.session) >= Level::kWrite;
}

bool Access::HasGoodLink(const std::string& session) const {
  for (const FollowLinkRow& link : table_.LinksOf(session)) {
    if (IsGood(link)) return true;
  }
  return false;
}

absl::StatusOr<FollowLinkRow> Access::FindLink(const std::string& digest) const {
  TF_RETURN_IF_ERROR(FetchIfMissing(RowName::Kind::kLink, digest));
  MutexLock lock(mutex_);
  return GoodLink(digest);
}

absl::Status Access::RecheckLink(const std::string& digest) const {
  MutexLock lock(mutex_);
  return GoodLink(digest).status();
}

absl::StatusOr<FollowLinkRow> Access::GoodLink(const std::string& digest) const {
  const FollowLinkRow* link = table_.FindLink(digest);
  if (link == nullptr || !IsGood(*link)) return LinkHasEnded();
  return *link;
}

absl::StatusOr<std::map<std::string, Holdings>> Access::HoldingsByOwner() const {
  return queries_.HoldingsByOwner();
}

absl::Status Access::CheckStorageQuota(const Principal& caller, int64_t bytes) const {
  // A deleted file is gone in a moment.
  constexpr std::chrono::seconds kUntilDeleted{5};
  if (most_bytes_ == 0 || caller.anonymous()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const Holdings held, queries_.HoldingsOf(caller.name));
  if (bytes <= most_bytes_ - held.bytes) return absl::OkStatus();
  return QuotaExceeded("MiB of meshes, cases and predictions", "disk-mib", most_bytes_ >> 20,
                       kUntilDeleted);
}

bool Access::KnowsSession(const std::string& id) const {
  FetchIfMissing(RowName::Kind::kSession, id).IgnoreError();
  MutexLock lock(mutex_);
  return index_.FindSession(id) != nullptr;
}

bool Access::KnowsPrediction(const std::string& id) const {
  FetchIfMissing(RowName::Kind::kPrediction, id).IgnoreError();
  MutexLock lock(mutex_);
  return index_.FindPrediction(id) != nullptr;
}

std::string Access::OwnerOf(const std::string& session) const {
  MutexLock lock(mutex_);
  const ResourceIndex::Session* found = index_.FindSession(session);
  return found == nullptr ? "" : found->owner;
}

}  // namespace tissueform
