// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access_changes.h"

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

absl::Status TooMany(absl::string_view what, int limit, absl::string_view option) {
  return absl::ResourceExhaustedError(absl::StrCat(
      "it has ", limit, " ", what, ", which is the limit; revoke some or raise ", option));
}

absl::Status NoResource(absl::string_view resource) {
  absl::string_view name = resource;
  if (absl::ConsumePrefix(&name, kSessionsPrefix)) return NoSuchSession(std::string(name));
  if (absl::ConsumePrefix(&name, kPredictionsPrefix)) return NoPrediction(name);
  absl::ConsumePrefix(&name, kCasesPrefix);
  return NoCase(name);
}

}  // namespace

absl::Status AccessChanges::MayOwn(const Principal& caller, const std::string& resource) {
  absl::string_view name = resource;
  if (absl::ConsumePrefix(&name, kProjectsPrefix)) return CheckAccessName(name, "project");
  TF_RETURN_IF_ERROR(CheckAccessName(resource, "resource"));
  absl::StatusOr<Access::Found> found = Access::Found::kYes;
  if (absl::ConsumePrefix(&name, kSessionsPrefix)) {
    found = access_.CheckSessionAccess(caller, std::string(name), Permission::kOwner);
  } else if (absl::ConsumePrefix(&name, kPredictionsPrefix)) {
    found = access_.CheckPredictionAccess(caller, std::string(name), Permission::kOwner);
  } else if (absl::ConsumePrefix(&name, kCasesPrefix)) {
    return access_.CheckCaseAccess(caller, std::string(name), Permission::kOwner).status();
  } else {
    return absl::InvalidArgumentError(
        "this resource cannot be shared; name a session, a prediction, a case or a "
        "project, \"sessions/{id}\"");
  }
  TF_RETURN_IF_ERROR(found.status());
  return *found == Access::Found::kYes ? absl::OkStatus() : NoResource(resource);
}

absl::Status AccessChanges::Share(const Principal& caller, ShareRow share) {
  TF_RETURN_IF_ERROR(CheckAccessName(share.principal, "principal"));
  TF_RETURN_IF_ERROR(MayOwn(caller, share.resource));
  share.owner = caller.name;
  const absl::Status kept = store_.PutShare(share, options_.max_shares_per_resource);
  if (absl::IsNotFound(kept)) return NoResource(share.resource);
  if (HasNoRoom(kept)) {
    return TooMany("shares", options_.max_shares_per_resource, "--max-shares-per-resource");
  }
  access_.ForgetLinks();  // the role may be less than before
  return kept;
}

absl::Status AccessChanges::Unshare(const Principal& caller, const std::string& resource,
                                    const std::string& with) {
  TF_RETURN_IF_ERROR(MayOwn(caller, resource));
  const absl::Status erased =
      store_.EraseShare({.resource = resource, .owner = caller.name, .principal = with});
  if (absl::IsNotFound(erased)) {
    return absl::NotFoundError("no such share; ListShares lists them");
  }
  access_.ForgetLinks();
  return erased;
}

absl::StatusOr<std::vector<ShareRow>> AccessChanges::SharesOf(const Principal& caller,
                                                              const std::string& resource) {
  TF_RETURN_IF_ERROR(MayOwn(caller, resource));
  return store_.SharesOf(caller.name, resource);
}

absl::Status AccessChanges::CheckLink(const Principal& caller, const FollowLinkRow& link) {
  TF_ASSIGN_OR_RETURN(const Access::Found found,
                      access_.CheckSessionAccess(caller, link.session, Permission::kWrite));
  if (found == Access::Found::kNo) return NoSuchSession(link.session);
  if (link.case_sha256.empty()) return absl::OkStatus();
  return access_.CheckCaseAccess(caller, link.case_sha256, Permission::kRead).status();
}

absl::Status AccessChanges::AddLink(const Principal& caller, FollowLinkRow link) {
  TF_RETURN_IF_ERROR(CheckLink(caller, link));
  link.maker = caller.name;
  const absl::Status kept = store_.PutLink(link, access_.clock_(), options_.max_links_per_session);
  if (absl::IsNotFound(kept)) return NoSuchSession(link.session);
  if (HasNoRoom(kept)) {
    return TooMany("follow links", options_.max_links_per_session, "--max-links-per-session");
  }
  return kept;
}

absl::Status AccessChanges::RemoveLinks(const Principal& caller, const std::string& session) {
  TF_RETURN_IF_ERROR(access_.CheckSessionAccess(caller, session, Permission::kWrite).status());
  const absl::Status erased = store_.EraseLinks(session);
  access_.ForgetLinks();
  return erased;
}

absl::Status AccessChanges::GrantMesh(const Principal& caller, const std::string& sha256,
                                      int64_t bytes) {
  return store_.PutMeshRight({.principal = caller.name, .sha256 = sha256, .bytes = bytes});
}

absl::Status AccessChanges::ReleaseMesh(const Principal& caller, const std::string& sha256) {
  return store_.EraseMeshRight(caller.name, sha256);
}

void AccessChanges::MeshRemoved(const std::string& sha256) {
  if (!store_.EraseMeshRights(sha256).ok()) spdlog::warn("rights of a removed mesh remain");
}

}  // namespace tissueform
