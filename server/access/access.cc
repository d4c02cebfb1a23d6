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

// What makes cases.
constexpr std::array<std::string_view, 4> kOfPublishers = {
    "CaseService.UploadCase", "PlanBuildService.CreateBuildDraft",
    "PlanBuildService.CreatePlanBuild", "PlanBuildService.UploadBuildFile"};

bool IsBridge(const Principal& caller) { return caller.roles.contains("bridge"); }
bool IsLink(const Principal& caller) { return !caller.only_session.empty(); }

// Remembered answers; they are few, and all go when there are more.
constexpr size_t kMaxRemembered = 10'000;

absl::Status LinkHasEnded() {
  return absl::UnauthenticatedError(
      "the follow link has expired or was revoked; ask its sender for a new one");
}

}  // namespace

absl::Status Access::CheckMethodAccess(const Principal& caller, std::string_view method) {
  if (IsLink(caller) && std::ranges::find(kOpenToLinks, method) == kOpenToLinks.end()) {
    return absl::PermissionDeniedError("a follow link can only watch its session; log in for this");
  }
  if (std::ranges::find(kOfPublishers, method) != kOfPublishers.end() && !caller.anonymous() &&
      !caller.roles.contains("publisher")) {
    return absl::PermissionDeniedError(
        "uploading cases and building plans requires the role publisher, which the token lacks; "
        "ask the "
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

Access::Level Access::LevelOf(const std::string& owner, const std::optional<ShareRole>& role,
                              const Principal& caller) {
  if (owner == caller.name) return Level::kOwner;
  if (!role.has_value()) return Level::kNothing;
  return *role == ShareRole::kPlanner ? Level::kWrite : Level::kRead;
}

absl::Status Access::CheckAsked() {
  MutexLock lock(mutex_);
  if (std::chrono::steady_clock::now() >= silent_until_) return absl::OkStatus();
  return absl::UnavailableError("the server's database does not answer; try again in a minute");
}

template <typename Answer>
absl::StatusOr<Answer> Access::Noting(absl::StatusOr<Answer> answer) {
  const Time now = std::chrono::steady_clock::now();
  MutexLock lock(mutex_);
  if (!absl::IsUnavailable(answer.status())) {
    away_since_.reset();
  } else {
    silent_until_ = now + kNotAskedAgain;
    if (!away_since_.has_value()) away_since_ = now;
  }
  return answer;
}

absl::StatusOr<std::optional<SessionGrant>> Access::AskForSession(const Principal& caller,
                                                                  const std::string& id) {
  using Grant = std::optional<SessionGrant>;
  const std::pair<std::string, std::string> key = {caller.name, id};
  const Time now = std::chrono::steady_clock::now();
  const absl::Status asked = CheckAsked();
  absl::StatusOr<Grant> grant =
      asked.ok() ? Noting(queries_.FindSession(id, caller.name)) : absl::StatusOr<Grant>(asked);
  MutexLock lock(mutex_);
  if (absl::IsUnavailable(grant.status())) {
    const auto known = sessions_.find(key);
    if (known == sessions_.end()) return grant;
    const auto& [remembered, at] = known->second;
    if (at < away_since_.value_or(now) - kRememberedWhenAway) return grant;
    return remembered;
  }
  TF_RETURN_IF_ERROR(grant.status());
  if (!grant->has_value()) {
    sessions_.erase(key);
  } else {
    if (sessions_.size() >= kMaxRemembered) sessions_.clear();
    sessions_[key] = {**grant, now};
  }
  return grant;
}

bool Access::IsGood(const LinkGrant& link) const {
  return link.link.expires_s > clock_() && link.maker.has_value() &&
         LevelOf(link.maker->owner, link.maker->role, Principal{.name = link.link.maker}) >=
             Level::kWrite;
}

absl::StatusOr<bool> Access::HasGoodLink(const std::string& session) {
  TF_RETURN_IF_ERROR(CheckAsked());
  TF_ASSIGN_OR_RETURN(const std::vector<LinkGrant> links, Noting(queries_.LinksOf(session)));
  return std::ranges::any_of(links, [this](const LinkGrant& link) { return IsGood(link); });
}

absl::StatusOr<Access::Level> Access::LinkLevel(const Principal& link, const std::string& session) {
  if (link.only_session != SessionResource(session)) return Level::kNothing;
  TF_ASSIGN_OR_RETURN(const bool good, HasGoodLink(session));
  return good ? Level::kRead : Level::kNothing;
}

absl::StatusOr<std::optional<Access::Level>> Access::SessionLevel(const Principal& caller,
                                                                  const std::string& id) {
  TF_ASSIGN_OR_RETURN(const std::optional<SessionGrant> grant, AskForSession(caller, id));
  if (!grant.has_value()) return std::nullopt;
  if (!IsLink(caller)) return LevelOf(grant->owner, grant->role, caller);
  TF_ASSIGN_OR_RETURN(const Level level, LinkLevel(caller, id));
  return level;
}

absl::StatusOr<Access::Found> Access::CheckSessionAccess(const Principal& caller,
                                                         const std::string& id, Permission need) {
  TF_ASSIGN_OR_RETURN(const std::optional<Level> found, SessionLevel(caller, id));
  const Level of_none = caller.anonymous() ? Level::kOwner : Level::kNothing;
  const Level level = found.value_or(of_none);
  if (level == Level::kNothing && caller.only_session == SessionResource(id)) return LinkHasEnded();
  TF_RETURN_IF_ERROR(Judge(level, need, NoSuchSession(id)));
  return found.has_value() ? Found::kYes : Found::kNo;
}

absl::Status Access::RecheckSessionAccess(const Principal& caller, const std::string& id,
                                          Permission need) {
  const absl::StatusOr<std::optional<Level>> found = SessionLevel(caller, id);
  if (absl::IsUnavailable(found.status())) return absl::OkStatus();
  TF_RETURN_IF_ERROR(found.status());
  if (!found->has_value()) return absl::OkStatus();
  if (**found == Level::kNothing && IsLink(caller)) return LinkHasEnded();
  return Judge(**found, need, NoSuchSession(id));
}

absl::StatusOr<std::optional<Access::Level>> Access::PredictionLevel(const Principal& caller,
                                                                     const std::string& id) {
  TF_ASSIGN_OR_RETURN(const std::optional<PredictionGrant> grant,
                      queries_.FindPrediction(id, caller.name));
  if (!grant.has_value()) return std::nullopt;
  if (IsLink(caller)) return Level::kNothing;
  if (grant->owner == caller.name) return Level::kOwner;
  const bool is_exported = IsBridge(caller) && exports_ != nullptr && exports_->IsExported(id);
  const bool is_shared =
      grant->role.has_value() || (grant->session.has_value() && grant->session->role.has_value());
  return is_exported || is_shared ? Level::kRead : Level::kNothing;
}

absl::StatusOr<Access::Found> Access::CheckPredictionAccess(const Principal& caller,
                                                            const std::string& id,
                                                            Permission need) {
  TF_ASSIGN_OR_RETURN(const std::optional<Level> found, PredictionLevel(caller, id));
  const Level of_none = caller.anonymous() ? Level::kOwner : Level::kNothing;
  TF_RETURN_IF_ERROR(Judge(found.value_or(of_none), need, NoPrediction(id)));
  return found.has_value() ? Found::kYes : Found::kNo;
}

absl::StatusOr<bool> Access::IsExportedCase(const CaseKey& key) {
  if (exports_ == nullptr) return false;
  const std::set<std::string> predictions = exports_->ExportedOfCase(key.sha256);
  if (predictions.empty()) return false;
  TF_ASSIGN_OR_RETURN(const std::set<std::string> planners,
                      queries_.OwnersOfPredictions(predictions));
  for (const std::string& planner : planners) {
    // A planner who may not read the case cannot open it to bridges by naming it in a prediction.
    if (planner == key.owner) return true;
    TF_ASSIGN_OR_RETURN(const std::vector<CaseGrant> cases,
                        queries_.FindCases(key.sha256, planner));
    const auto of_key = std::ranges::find(cases, key, &CaseGrant::key);
    if (of_key != cases.end() && of_key->role.has_value()) return true;
  }
  return false;
}

absl::StatusOr<CaseKey> Access::FindCase(const Principal& caller, const std::string& sha256,
                                         Permission need) {
  const CaseKey own = {.sha256 = sha256, .owner = caller.name};
  if (caller.anonymous()) return own;
  TF_ASSIGN_OR_RETURN(const std::vector<CaseGrant> cases, queries_.FindCases(sha256, caller.name));
  if (std::ranges::find(cases, own, &CaseGrant::key) != cases.end()) return own;
  for (const CaseGrant& grant : cases) {
    bool looks = grant.role.has_value();
    if (!looks && IsBridge(caller)) {
      TF_ASSIGN_OR_RETURN(looks, IsExportedCase(grant.key));
    }
    if (!looks) continue;
    TF_RETURN_IF_ERROR(Judge(Level::kRead, need, NoCase(sha256)));
    return grant.key;
  }
  return NoCase(sha256);
}

absl::StatusOr<CaseKey> Access::CheckCaseAccess(const Principal& caller, const std::string& sha256,
                                                Permission need) {
  return IsLink(caller) ? CaseOfLink(caller, sha256) : FindCase(caller, sha256, need);
}

absl::StatusOr<CaseKey> Access::CaseOfLink(const Principal& link, const std::string& sha256) {
  const std::string session(absl::StripPrefix(link.only_session, kSessionsPrefix));
  TF_ASSIGN_OR_RETURN(const std::vector<LinkGrant> links, queries_.LinksOf(session));
  bool any_good = false;
  for (const LinkGrant& grant : links) {
    if (!IsGood(grant)) continue;
    any_good = true;
    if (grant.link.case_sha256 != sha256) continue;
    absl::StatusOr<CaseKey> found =
        FindCase(Principal{.name = grant.link.maker}, sha256, Permission::kRead);
    if (!absl::IsNotFound(found.status())) return found;
  }
  if (!any_good) return LinkHasEnded();
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

absl::StatusOr<Access::Level> Access::MeshLevel(const Principal& caller,
                                                const std::string& sha256) {
  if (IsLink(caller)) {
    const std::string session(absl::StripPrefix(caller.only_session, kSessionsPrefix));
    TF_ASSIGN_OR_RETURN(const std::optional<SessionGrant> grant, AskForSession(caller, session));
    if (!grant.has_value() || grant->mesh_sha256 != sha256) return Level::kNothing;
    return LinkLevel(caller, session);
  }
  TF_ASSIGN_OR_RETURN(const MeshUse use, queries_.FindMeshUse(sha256));
  const bool unclaimed = caller.anonymous() && use.senders.empty();
  if (unclaimed || use.senders.contains(caller.name)) return Level::kOwner;
  TF_ASSIGN_OR_RETURN(const bool shown, queries_.IsMeshShown(sha256, caller.name));
  if (shown) return Level::kRead;
  if (!IsBridge(caller) || exports_ == nullptr) return Level::kNothing;
  TF_ASSIGN_OR_RETURN(const std::set<std::string> predictions, queries_.PredictionsOfMesh(sha256));
  const bool is_exported = std::ranges::any_of(
      predictions, [this](const std::string& id) { return exports_->IsExported(id); });
  return is_exported ? Level::kRead : Level::kNothing;
}

absl::Status Access::CheckMeshAccess(const Principal& caller, const std::string& sha256,
                                     Permission need) {
  TF_ASSIGN_OR_RETURN(const Level level, MeshLevel(caller, sha256));
  return Judge(level, need, NoSuchMesh());
}

absl::StatusOr<std::optional<std::set<std::string>>> Access::MeshesNear(const Principal& caller) {
  if (caller.anonymous() || IsBridge(caller)) return std::nullopt;
  return queries_.MeshesNear(caller.name);
}

absl::StatusOr<std::set<std::string>> Access::SharedSessions(const Principal& caller) {
  return queries_.SharedSessions(caller.name);
}

absl::StatusOr<std::set<std::string>> Access::SharedPredictions(const Principal& caller) {
  TF_ASSIGN_OR_RETURN(std::set<std::string> shared, queries_.SharedPredictions(caller.name));
  if (IsBridge(caller) && exports_ != nullptr) shared.merge(exports_->Exported());
  return shared;
}

absl::StatusOr<std::set<CaseKey>> Access::ExportedCases() {
  std::set<CaseKey> exported;
  for (const std::string& sha256 : exports_->ExportedCases()) {
    TF_ASSIGN_OR_RETURN(const std::vector<CaseGrant> cases, queries_.FindCases(sha256, ""));
    for (const CaseGrant& found : cases) {
      TF_ASSIGN_OR_RETURN(const bool open, IsExportedCase(found.key));
      if (open) exported.insert(found.key);
    }
  }
  return exported;
}

absl::StatusOr<std::set<CaseKey>> Access::SharedCases(const Principal& caller) {
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

absl::Status Access::CheckProjectItemAccess(const Principal& caller, const ProjectKey& project,
                                            const absl::Status& not_found, Permission need) {
  if (project.owner == caller.name) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const auto shared, queries_.SharedProjects(caller.name));
  const auto found = project.name.empty() ? shared.end() : shared.find(project);
  const auto role = found == shared.end() ? std::nullopt : std::optional<ShareRole>(found->second);
  return Judge(LevelOf(project.owner, role, caller), need, not_found);
}

absl::StatusOr<std::map<ProjectKey, ShareRole>> Access::SharedProjects(const Principal& caller) {
  return queries_.SharedProjects(caller.name);
}

absl::StatusOr<FollowLinkRow> Access::FindLink(const std::string& digest) {
  const Time now = std::chrono::steady_clock::now();
  int64_t forgotten = 0;
  {
    MutexLock lock(mutex_);
    forgotten = links_forgotten_;
    const auto known = links_.find(digest);
    if (known != links_.end() && now - known->second.second < kLinkRemembered &&
        known->second.first.expires_s > clock_()) {
      return known->second.first;
    }
  }
  TF_RETURN_IF_ERROR(CheckAsked());
  TF_ASSIGN_OR_RETURN(const std::optional<LinkGrant> found, Noting(queries_.FindLink(digest)));
  if (!found.has_value() || !IsGood(*found)) return LinkHasEnded();
  MutexLock lock(mutex_);
  if (links_.size() >= kMaxRemembered) links_.clear();
  if (forgotten == links_forgotten_) links_[digest] = {found->link, now};
  return found->link;
}

void Access::ForgetLinks() {
  MutexLock lock(mutex_);
  links_.clear();
  ++links_forgotten_;
}

absl::Status Access::RecheckLink(const std::string& digest) {
  const absl::Status status = FindLink(digest).status();
  return absl::IsUnavailable(status) ? absl::OkStatus() : status;
}

absl::StatusOr<std::map<std::string, Holdings>> Access::HoldingsByOwner() {
  return queries_.HoldingsByOwner();
}

absl::Status Access::CheckStorageQuota(const Principal& caller, int64_t bytes) {
  // A deleted file is gone in a moment.
  constexpr std::chrono::seconds kUntilDeleted{5};
  if (most_bytes_ == 0 || caller.anonymous()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const Holdings held, queries_.HoldingsOf(caller.name));
  if (bytes <= most_bytes_ - held.bytes) return absl::OkStatus();
  return QuotaExceeded("MiB of meshes, cases and predictions", "disk-mib", most_bytes_ >> 20,
                       kUntilDeleted);
}

}  // namespace tissueform
