// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/access_queries.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

// Shares of a session `s` or of its project, to the principal $2. Records are NULL without one.
#define TF_JOIN_SHARES_OF_SESSION(principal)                     \
  "LEFT JOIN shares a ON a.principal = " principal               \
  " AND a.owner = s.owner AND a.resource = 'sessions/' || s.id " \
  "LEFT JOIN shares b ON b.principal = " principal               \
  " AND b.owner = s.owner AND b.resource = 'projects/' || s.project "

#define TF_SELECT_LINKS                                                                      \
  "SELECT l.name, l.record, s.id, s.owner, s.mesh_sha256, s.project, a.record, b.record "    \
  "FROM follow_links l LEFT JOIN sessions s ON s.id = l.session " TF_JOIN_SHARES_OF_SESSION( \
      "l.maker")

std::string ResourceOfSession(absl::string_view id) { return absl::StrCat("sessions/", id); }
std::string ResourceOfPrediction(absl::string_view id) { return absl::StrCat("predictions/", id); }
std::string ResourceOfCase(absl::string_view sha256) { return absl::StrCat("cases/", sha256); }
std::string ResourceOfProject(absl::string_view name) { return absl::StrCat("projects/", name); }

// False for bytes that are damaged or those of another row.
template <typename Row>
bool ReadSealedRow(absl::string_view key, absl::string_view sealed, Row* row) {
  const absl::StatusOr<absl::string_view> bytes = Unseal(sealed);
  return bytes.ok() && ParseRow(*bytes, row).ok() && KeyOf(*row) == key;
}

// The role of a joined share. Without a share, `sealed` is empty.
std::optional<ShareRole> RoleOf(absl::string_view sealed, absl::string_view owner,
                                const std::string& resource, absl::string_view principal) {
  if (sealed.empty()) return std::nullopt;
  const std::string key = KeyOf(ShareRow{
      .resource = resource, .owner = std::string(owner), .principal = std::string(principal)});
  ShareRow share;
  if (!ReadSealedRow(key, sealed, &share)) return std::nullopt;
  return share.role;
}

// Columns from `first`: id, owner, mesh_sha256, project, and the records of both shares.
SessionGrant ReadSessionGrant(const SqlRows& rows, size_t row, size_t first,
                              absl::string_view principal) {
  const absl::string_view owner = rows.Text(row, first + 1);
  return {.owner = std::string(owner),
          .mesh_sha256 = std::string(rows.Text(row, first + 2)),
          .role = std::max(RoleOf(rows.Text(row, first + 4), owner,
                                  ResourceOfSession(rows.Text(row, first)), principal),
                           RoleOf(rows.Text(row, first + 5), owner,
                                  ResourceOfProject(rows.Text(row, first + 3)), principal))};
}

std::optional<LinkGrant> ReadLinkGrant(const SqlRows& rows, size_t row) {
  LinkGrant grant;
  if (!ReadSealedRow(rows.Text(row, 0), rows.Text(row, 1), &grant.link)) return std::nullopt;
  if (rows.Text(row, 2) == grant.link.session) {
    grant.maker = ReadSessionGrant(rows, row, 2, grant.link.maker);
  }
  return grant;
}

// Runs one reading statement.
absl::StatusOr<SqlRows> Ask(SqlDatabase* database, const char* sql, std::vector<SqlValue> values,
                            bool brief = false) {
  SqlRows rows;
  TF_RETURN_IF_ERROR(database->Run({.work = [&](SqlTransaction& transaction) -> absl::Status {
                                      TF_ASSIGN_OR_RETURN(rows, transaction.Query(sql, values));
                                      return absl::OkStatus();
                                    },
                                    .reads = true,
                                    .repeatable = true,
                                    .brief = brief}));
  return rows;
}

// Rows whose last three columns are owner, resource and record of a share to `principal`; those
// whose seal holds give their first columns to `take`.
template <typename Take>
void ForEachShared(const SqlRows& rows, size_t share, absl::string_view principal, Take take) {
  for (size_t row = 0; row < rows.size(); ++row) {
    const std::string resource(rows.Text(row, share + 1));
    if (RoleOf(rows.Text(row, share + 2), rows.Text(row, share), resource, principal).has_value()) {
      take(row);
    }
  }
}

// `sql` returns the name, owner, resource and record of resources shared with $1.
absl::StatusOr<std::set<std::string>> SharedNames(SqlDatabase* database, const char* sql,
                                                  const std::string& principal) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows, Ask(database, sql, {principal}));
  std::set<std::string> shared;
  ForEachShared(rows, 1, principal, [&](size_t row) {
    if (rows.Text(row, 1) != principal) shared.emplace(rows.Text(row, 0));
  });
  return shared;
}

std::set<std::string> NamesIn(const SqlRows& rows) {
  std::set<std::string> names;
  for (size_t row = 0; row < rows.size(); ++row) names.emplace(rows.Text(row, 0));
  return names;
}

absl::Status EraseSharesOf(SqlTransaction& transaction, const std::string& owner,
                           const std::string& resource) {
  return transaction.Run("DELETE FROM shares WHERE resource = $1 AND owner = $2",
                         {resource, owner});
}

}  // namespace

absl::StatusOr<std::optional<SessionGrant>> AccessQueries::FindSession(
    const std::string& id, const std::string& principal) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      Ask(database_,
                          "SELECT s.id, s.owner, s.mesh_sha256, s.project, a.record, b.record FROM "
                          "sessions s " TF_JOIN_SHARES_OF_SESSION("$2") "WHERE s.id = $1",
                          {id, principal}, /*brief=*/true));
  if (rows.empty()) return std::nullopt;
  return ReadSessionGrant(rows, 0, 0, principal);
}

absl::StatusOr<std::optional<PredictionGrant>> AccessQueries::FindPrediction(
    const std::string& id, const std::string& principal) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT p.owner, c.record, s.id, s.owner, s.mesh_sha256, s.project, a.record, b.record "
          "FROM predictions p LEFT JOIN shares c ON c.principal = $2 AND c.owner = p.owner AND "
          "c.resource = 'predictions/' || p.id LEFT JOIN sessions s ON s.id = p.session AND "
          "s.owner = p.owner " TF_JOIN_SHARES_OF_SESSION("$2") "WHERE p.id = $1",
          {id, principal}));
  if (rows.empty()) return std::nullopt;
  const absl::string_view owner = rows.Text(0, 0);
  PredictionGrant grant{
      .owner = std::string(owner),
      .role = RoleOf(rows.Text(0, 1), owner, ResourceOfPrediction(id), principal)};
  if (!rows.Text(0, 2).empty()) grant.session = ReadSessionGrant(rows, 0, 2, principal);
  return grant;
}

absl::StatusOr<std::vector<CaseGrant>> AccessQueries::FindCases(const std::string& sha256,
                                                                const std::string& principal) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT c.owner, c.project, a.record, b.record FROM cases c "
          "LEFT JOIN shares a ON a.principal = $2 AND a.owner = c.owner AND a.resource = 'cases/' "
          "|| c.sha256 LEFT JOIN shares b ON b.principal = $2 AND b.owner = c.owner AND b.resource "
          "= 'projects/' || c.project WHERE c.sha256 = $1 ORDER BY c.owner",
          {sha256, principal}));
  std::vector<CaseGrant> cases(rows.size());
  for (size_t row = 0; row < rows.size(); ++row) {
    const absl::string_view owner = rows.Text(row, 0);
    cases[row] = {
        .key = {.sha256 = sha256, .owner = std::string(owner)},
        .role = std::max(
            RoleOf(rows.Text(row, 2), owner, ResourceOfCase(sha256), principal),
            RoleOf(rows.Text(row, 3), owner, ResourceOfProject(rows.Text(row, 1)), principal))};
  }
  return cases;
}

absl::StatusOr<std::optional<LinkGrant>> AccessQueries::FindLink(const std::string& digest) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows, Ask(database_, TF_SELECT_LINKS "WHERE l.name = $1",
                                              {digest}, /*brief=*/true));
  if (rows.empty()) return std::nullopt;
  return ReadLinkGrant(rows, 0);
}

absl::StatusOr<std::vector<LinkGrant>> AccessQueries::LinksOf(const std::string& session) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      Ask(database_, TF_SELECT_LINKS "WHERE l.session = $1 ORDER BY l.name",
                          {session}, /*brief=*/true));
  std::vector<LinkGrant> links;
  for (size_t row = 0; row < rows.size(); ++row) {
    std::optional<LinkGrant> link = ReadLinkGrant(rows, row);
    if (link.has_value() && link->link.session == session) links.push_back(*std::move(link));
  }
  return links;
}

absl::StatusOr<MeshUse> AccessQueries::FindMeshUse(const std::string& sha256) {
  return ReadSql<MeshUse>(database_, [&](SqlTransaction& transaction) -> absl::StatusOr<MeshUse> {
    MeshUse use;
    TF_RETURN_IF_ERROR(transaction.ReadOneMoment());
    TF_ASSIGN_OR_RETURN(
        const SqlRows rights,
        transaction.Query("SELECT name, record FROM mesh_rights WHERE sha256 = $1", {sha256}));
    for (size_t row = 0; row < rights.size(); ++row) {
      MeshRight right;
      if (!ReadSealedRow(rights.Text(row, 0), rights.Text(row, 1), &right)) continue;
      if (right.sha256 == sha256) use.senders.insert(right.principal);
    }
    TF_ASSIGN_OR_RETURN(
        const SqlRows sessions,
        transaction.Query(
            "SELECT owner, count(*) FROM sessions WHERE mesh_sha256 = $1 GROUP BY owner",
            {sha256}));
    for (size_t row = 0; row < sessions.size(); ++row) {
      use.sessions[std::string(sessions.Text(row, 0))] = sessions.Integer(row, 1);
    }
    return use;
  });
}

absl::StatusOr<bool> AccessQueries::IsMeshShown(const std::string& sha256,
                                                const std::string& principal) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows own,
      Ask(database_,
          "SELECT 1 FROM sessions WHERE mesh_sha256 = $1 AND owner = $2 UNION SELECT 1 FROM "
          "predictions WHERE mesh_sha256 = $1 AND owner = $2",
          {sha256, principal}));
  if (!own.empty()) return true;
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT h.owner, h.resource, h.record FROM sessions s JOIN shares h ON h.principal = $2 "
          "AND h.owner = s.owner AND h.resource IN ('sessions/' || s.id, 'projects/' || s.project) "
          "WHERE s.mesh_sha256 = $1 "
          "UNION ALL SELECT h.owner, h.resource, h.record FROM predictions p JOIN shares h ON "
          "h.principal = $2 AND h.owner = p.owner AND h.resource = 'predictions/' || p.id WHERE "
          "p.mesh_sha256 = $1 "
          "UNION ALL SELECT h.owner, h.resource, h.record FROM predictions p JOIN sessions s ON "
          "s.id = p.session AND s.owner = p.owner JOIN shares h ON h.principal = $2 AND h.owner = "
          "s.owner AND h.resource IN ('sessions/' || s.id, 'projects/' || s.project) WHERE "
          "p.mesh_sha256 = $1",
          {sha256, principal}));
  bool shown = false;
  ForEachShared(rows, 0, principal, [&shown](size_t) { shown = true; });
  return shown;
}

absl::StatusOr<std::set<std::string>> AccessQueries::PredictionsOfMesh(const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_, "SELECT id FROM predictions WHERE mesh_sha256 = $1", {sha256}));
  return NamesIn(rows);
}

absl::StatusOr<std::set<std::string>> AccessQueries::MeshesNear(const std::string& principal) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT sha256 FROM mesh_rights WHERE principal = $1 "
          "UNION SELECT mesh_sha256 FROM sessions WHERE owner = $1 "
          "UNION SELECT mesh_sha256 FROM predictions WHERE owner = $1 "
          "UNION SELECT s.mesh_sha256 FROM shares h JOIN sessions s ON s.owner = h.owner AND "
          "h.resource IN ('sessions/' || s.id, 'projects/' || s.project) WHERE h.principal = $1 "
          "UNION SELECT p.mesh_sha256 FROM shares h JOIN predictions p ON p.owner = h.owner AND "
          "h.resource = 'predictions/' || p.id WHERE h.principal = $1 "
          "UNION SELECT p.mesh_sha256 FROM shares h JOIN sessions s ON s.owner = h.owner AND "
          "h.resource IN ('sessions/' || s.id, 'projects/' || s.project) JOIN predictions p ON "
          "p.session = s.id AND p.owner = s.owner WHERE h.principal = $1",
          {principal}));
  return NamesIn(rows);
}

absl::StatusOr<std::set<std::string>> AccessQueries::SharedSessions(const std::string& principal) {
  // The lengths of "sessions/" and "projects/" are 9.
  return SharedNames(
      database_,
      "SELECT s.id, h.owner, h.resource, h.record FROM shares h JOIN sessions s ON s.id = "
      "substr(h.resource, 10) AND s.owner = h.owner WHERE h.principal = $1 AND "
      "substr(h.resource, 1, 9) = 'sessions/' "
      "UNION ALL SELECT s.id, h.owner, h.resource, h.record FROM shares h JOIN sessions s ON "
      "s.owner = h.owner AND s.project = substr(h.resource, 10) WHERE h.principal = $1 AND "
      "substr(h.resource, 1, 9) = 'projects/'",
      principal);
}

absl::StatusOr<std::set<std::string>> AccessQueries::SharedPredictions(
    const std::string& principal) {
  // The length of "predictions/" is 12.
  return SharedNames(
      database_,
      "SELECT p.id, h.owner, h.resource, h.record FROM shares h JOIN predictions p ON p.id = "
      "substr(h.resource, 13) AND p.owner = h.owner WHERE h.principal = $1 AND "
      "substr(h.resource, 1, 12) = 'predictions/' "
      "UNION ALL SELECT p.id, h.owner, h.resource, h.record FROM shares h JOIN sessions s ON "
      "s.owner = h.owner AND h.resource IN ('sessions/' || s.id, 'projects/' || s.project) "
      "JOIN predictions p ON p.session = s.id AND p.owner = s.owner WHERE h.principal = $1",
      principal);
}

absl::StatusOr<std::set<CaseKey>> AccessQueries::SharedCases(const std::string& principal) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT c.sha256, h.owner, h.resource, h.record FROM shares h JOIN cases c ON c.owner = "
          "h.owner AND h.resource IN ('cases/' || c.sha256, 'projects/' || c.project) WHERE "
          "h.principal = $1",
          {principal}));
  std::set<CaseKey> shared;
  ForEachShared(rows, 1, principal, [&](size_t row) {
    shared.insert(
        {.sha256 = std::string(rows.Text(row, 0)), .owner = std::string(rows.Text(row, 1))});
  });
  return shared;
}

absl::StatusOr<std::map<ProjectKey, ShareRole>> AccessQueries::SharedProjects(
    const std::string& principal) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      Ask(database_,
                          "SELECT owner, resource, record FROM shares WHERE principal = $1 AND "
                          "resource LIKE 'projects/%'",
                          {principal}));
  std::map<ProjectKey, ShareRole> shared;
  for (size_t row = 0; row < rows.size(); ++row) {
    const std::string owner(rows.Text(row, 0));
    const std::string resource(rows.Text(row, 1));
    const auto role = RoleOf(rows.Text(row, 2), owner, resource, principal);
    if (role.has_value()) {
      shared[{.owner = owner, .name = std::string(absl::StripPrefix(resource, "projects/"))}] =
          *role;
    }
  }
  return shared;
}

absl::StatusOr<std::set<std::string>> AccessQueries::OwnersOfPredictions(
    const std::set<std::string>& ids) {
  const std::string names = SqlNames(ids);
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT DISTINCT owner FROM predictions WHERE id = ANY (string_to_array($1, chr(31)))",
          {names}));
  return NamesIn(rows);
}

absl::StatusOr<std::map<std::string, Holdings>> AccessQueries::HoldingsByOwner() {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(database_,
          "SELECT owner, count(*), 0 FROM sessions GROUP BY owner "
          "UNION ALL SELECT owner, 0, sum(bytes) FROM predictions GROUP BY owner "
          "UNION ALL SELECT owner, 0, sum(bytes) FROM cases GROUP BY owner "
          "UNION ALL SELECT principal, 0, sum(bytes) FROM mesh_rights GROUP BY principal",
          {}));
  std::map<std::string, Holdings> holdings;
  for (size_t row = 0; row < rows.size(); ++row) {
    Holdings& of_owner = holdings[std::string(rows.Text(row, 0))];
    of_owner.sessions += rows.Integer(row, 1);
    of_owner.bytes += rows.Integer(row, 2);
  }
  return holdings;
}

absl::StatusOr<Holdings> AccessQueries::HoldingsOf(const std::string& owner) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      Ask(database_,
                          "SELECT (SELECT count(*) FROM sessions WHERE owner = $1), "
                          "(SELECT coalesce(sum(bytes), 0) FROM predictions WHERE owner = $1) + "
                          "(SELECT coalesce(sum(bytes), 0) FROM cases WHERE owner = $1) + "
                          "(SELECT coalesce(sum(bytes), 0) FROM mesh_rights WHERE principal = $1)",
                          {owner}));
  return Holdings{.sessions = rows.Integer(0, 0), .bytes = rows.Integer(0, 1)};
}

absl::Status EraseAccessToSession(SqlTransaction& transaction, const std::string& owner,
                                  const std::string& id) {
  TF_RETURN_IF_ERROR(EraseSharesOf(transaction, owner, ResourceOfSession(id)));
  return transaction.Run("DELETE FROM follow_links WHERE session = $1", {id});
}

absl::Status EraseAccessToPrediction(SqlTransaction& transaction, const std::string& owner,
                                     const std::string& id) {
  return EraseSharesOf(transaction, owner, ResourceOfPrediction(id));
}

absl::Status EraseAccessToCase(SqlTransaction& transaction, const CaseKey& key) {
  return EraseSharesOf(transaction, key.owner, ResourceOfCase(key.sha256));
}

absl::Status EraseAccessToMesh(SqlTransaction& transaction, const std::string& sha256) {
  return transaction.Run("DELETE FROM mesh_rights WHERE sha256 = $1", {sha256});
}

}  // namespace tissueform
