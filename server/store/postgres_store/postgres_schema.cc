// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_schema.h"

#include <string>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/store_index.h"

namespace tissueform {
namespace {

// Any number that other programs on this database do not lock.
constexpr int64_t kTakeTurns = 6073473466130133612;

// The first version that a PostgreSQL database has had.
constexpr char kTablesOfVersion4[] = R"sql(
CREATE TABLE tissueform_version (version bigint NOT NULL);
CREATE FUNCTION tissueform_now() RETURNS timestamptz VOLATILE LANGUAGE sql
  AS 'SELECT clock_timestamp()';

CREATE TABLE sessions (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  id text COLLATE "C" NOT NULL UNIQUE, owner text COLLATE "C" NOT NULL, record bytea NOT NULL,
  mesh text COLLATE "C");
CREATE TABLE session_states (key bigint PRIMARY KEY REFERENCES sessions(key) ON DELETE CASCADE,
  etag text NOT NULL, epoch bigint NOT NULL, handles bigint NOT NULL, poses bytea NOT NULL,
  created_s bigint NOT NULL, last_used_s bigint NOT NULL,
  holder text NOT NULL DEFAULT '', node text NOT NULL DEFAULT '',
  lease_until timestamptz NOT NULL DEFAULT '-infinity');
CREATE INDEX session_states_by_holder ON session_states(holder) WHERE holder <> '';

CREATE TABLE blobs (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  sha256 text COLLATE "C" NOT NULL UNIQUE, bytes bigint NOT NULL);
CREATE TABLE blob_pieces (blob bigint NOT NULL REFERENCES blobs(key) ON DELETE CASCADE,
  number bigint NOT NULL, sha256 text NOT NULL, bytes bytea NOT NULL, PRIMARY KEY (blob, number));
ALTER TABLE blob_pieces ALTER COLUMN bytes SET STORAGE EXTERNAL;

CREATE TABLE meshes (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  sha256 text COLLATE "C" NOT NULL UNIQUE REFERENCES blobs(sha256),
  record bytea NOT NULL, last_used_s bigint NOT NULL);
ALTER TABLE sessions ADD FOREIGN KEY (mesh) REFERENCES meshes(sha256);
CREATE INDEX sessions_by_mesh ON sessions(mesh);
CREATE TABLE predictions (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  id text COLLATE "C" NOT NULL UNIQUE, owner text COLLATE "C" NOT NULL, session text NOT NULL,
  case_sha256 text NOT NULL,
  positions_sha256 text COLLATE "C" NOT NULL REFERENCES blobs(sha256), record bytea NOT NULL);
CREATE INDEX predictions_by_positions ON predictions(positions_sha256);
CREATE TABLE cases (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  sha256 text COLLATE "C" NOT NULL REFERENCES blobs(sha256), owner text COLLATE "C" NOT NULL,
  record bytea NOT NULL, last_used_s bigint NOT NULL, UNIQUE (sha256, owner));
CREATE TABLE shares (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text COLLATE "C" NOT NULL UNIQUE, record bytea NOT NULL);
CREATE TABLE follow_links (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text COLLATE "C" NOT NULL UNIQUE, record bytea NOT NULL);
CREATE TABLE mesh_rights (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text COLLATE "C" NOT NULL UNIQUE, record bytea NOT NULL);

CREATE FUNCTION tissueform_tell_row() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  name text;
BEGIN
  IF TG_OP = 'INSERT' THEN
    EXECUTE format('SELECT left(($1).%I, 4000)', TG_ARGV[1]) INTO name USING NEW;
  ELSE
    EXECUTE format('SELECT left(($1).%I, 4000)', TG_ARGV[1]) INTO name USING OLD;
  END IF;
  PERFORM pg_notify('tissueform_changes', TG_ARGV[0] || ' ' || name);
  RETURN NULL;
END $$;
CREATE FUNCTION tissueform_tell_case() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  told record;
BEGIN
  IF TG_OP = 'INSERT' THEN told := NEW; ELSE told := OLD; END IF;
  PERFORM pg_notify('tissueform_changes',
    TG_ARGV[0] || ' ' || told.sha256 || ' ' || left(told.owner, 1000));
  RETURN NULL;
END $$;
CREATE FUNCTION tissueform_tell() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  PERFORM pg_notify('tissueform_changes', TG_ARGV[0] || ' ');
  RETURN NULL;
END $$;
CREATE TRIGGER tell_created AFTER INSERT ON sessions FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('session_created', 'id');
CREATE TRIGGER tell_deleted AFTER DELETE ON sessions FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('session_deleted', 'id');
CREATE TRIGGER tell_changed AFTER UPDATE ON sessions FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('session_changed', 'id');
CREATE TRIGGER tell_deleted AFTER DELETE ON meshes FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('mesh_deleted', 'sha256');
CREATE TRIGGER tell_created AFTER INSERT ON cases FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_case('case_created');
CREATE TRIGGER tell_deleted AFTER DELETE ON cases FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_case('case_deleted');
CREATE TRIGGER tell_created AFTER INSERT ON predictions FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('prediction_created', 'id');
CREATE TRIGGER tell_deleted AFTER DELETE ON predictions FOR EACH ROW
  EXECUTE FUNCTION tissueform_tell_row('prediction_deleted', 'id');
CREATE TRIGGER tell_changed AFTER INSERT OR UPDATE OR DELETE ON shares FOR EACH STATEMENT
  EXECUTE FUNCTION tissueform_tell('access_changed');
CREATE TRIGGER tell_changed AFTER INSERT OR UPDATE OR DELETE ON follow_links FOR EACH STATEMENT
  EXECUTE FUNCTION tissueform_tell('access_changed');
CREATE TRIGGER tell_changed AFTER INSERT OR UPDATE OR DELETE ON mesh_rights FOR EACH STATEMENT
  EXECUTE FUNCTION tissueform_tell('access_changed');
INSERT INTO tissueform_version VALUES (4);
)sql";

constexpr char kVersion5[] = R"sql(
CREATE TABLE exports (key bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text COLLATE "C" NOT NULL UNIQUE, record bytea NOT NULL, version bigint NOT NULL);
CREATE TRIGGER tell_changed AFTER INSERT OR UPDATE OR DELETE ON exports FOR EACH STATEMENT
  EXECUTE FUNCTION tissueform_tell('exports_changed');
CREATE TABLE nodes (holder text PRIMARY KEY, name text COLLATE "C" NOT NULL,
  free_bytes bigint NOT NULL, draining boolean NOT NULL, seen timestamptz NOT NULL);
CREATE SEQUENCE session_epochs MINVALUE 2;
)sql";

constexpr char kVersion6[] = R"sql(
ALTER TABLE sessions ADD COLUMN mesh_sha256 text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN project text COLLATE "C" NOT NULL DEFAULT '';
CREATE INDEX sessions_by_mesh_sha256 ON sessions(mesh_sha256, owner);
CREATE INDEX sessions_by_owner ON sessions(owner, project);
ALTER TABLE predictions ALTER COLUMN session TYPE text COLLATE "C",
  ADD COLUMN mesh_sha256 text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN bytes bigint NOT NULL DEFAULT 0;
CREATE INDEX predictions_by_mesh_sha256 ON predictions(mesh_sha256, owner);
CREATE INDEX predictions_by_owner ON predictions(owner, session);
ALTER TABLE cases ADD COLUMN project text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN bytes bigint NOT NULL DEFAULT 0;
CREATE INDEX cases_by_owner ON cases(owner, project);
ALTER TABLE shares ADD COLUMN owner text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN resource text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN principal text COLLATE "C" NOT NULL DEFAULT '';
CREATE INDEX shares_by_principal ON shares(principal, owner, resource);
CREATE INDEX shares_by_resource ON shares(resource, owner);
ALTER TABLE follow_links ADD COLUMN session text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN maker text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN expires_s bigint NOT NULL DEFAULT 0;
CREATE INDEX follow_links_by_session ON follow_links(session);
ALTER TABLE mesh_rights ADD COLUMN principal text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN sha256 text COLLATE "C" NOT NULL DEFAULT '',
  ADD COLUMN bytes bigint NOT NULL DEFAULT 0;
CREATE INDEX mesh_rights_by_principal ON mesh_rights(principal);
CREATE INDEX mesh_rights_by_sha256 ON mesh_rights(sha256);
)sql";

// Servers ask for rights, cases and predictions when a call names them, so they need no notice of
// their changes.
constexpr char kVersion7[] = R"sql(
DROP TRIGGER IF EXISTS tell_created ON cases;
DROP TRIGGER IF EXISTS tell_deleted ON cases;
DROP TRIGGER IF EXISTS tell_created ON predictions;
DROP TRIGGER IF EXISTS tell_deleted ON predictions;
DROP TRIGGER IF EXISTS tell_changed ON shares;
DROP TRIGGER IF EXISTS tell_changed ON follow_links;
DROP TRIGGER IF EXISTS tell_changed ON mesh_rights;
DROP FUNCTION IF EXISTS tissueform_tell_case();
)sql";

absl::Status ChangeSchema(const std::string& name, PostgresTransaction& transaction) {
  TF_RETURN_IF_ERROR(transaction.TakeTurns(kTakeTurns));
  TF_ASSIGN_OR_RETURN(const int64_t version, PostgresSchemaVersion(transaction));
  if (version > kPostgresSchemaVersion) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database ", name, " was written by a newer server (version ", version, ", this one knows ",
        kPostgresSchemaVersion, "); start the newer server, or name another database"));
  }
  if (version == kPostgresSchemaVersion) return absl::OkStatus();
  if (version < 4) TF_RETURN_IF_ERROR(transaction.Execute(kTablesOfVersion4));
  if (version < 5) {
    TF_RETURN_IF_ERROR(transaction.Execute(kVersion5));
    TF_RETURN_IF_ERROR(RaiseSessionEpochs(transaction));
  }
  if (version < 6) {
    TF_RETURN_IF_ERROR(transaction.Execute(kVersion6));
    TF_RETURN_IF_ERROR(FillIndex(transaction));
  }
  if (version < 7) TF_RETURN_IF_ERROR(transaction.Execute(kVersion7));
  return transaction.Run("UPDATE tissueform_version SET version = $1", {kPostgresSchemaVersion});
}

}  // namespace

absl::StatusOr<int64_t> PostgresSchemaVersion(PostgresTransaction& transaction) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows found,
      transaction.Query("SELECT (to_regclass('tissueform_version') IS NOT NULL)::int", {}));
  if (found.Integer(0, 0) == 0) return 0;
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query("SELECT max(version) FROM tissueform_version", {}));
  return rows.Integer(0, 0);
}

absl::Status RaiseSessionEpochs(PostgresTransaction& transaction) {
  return transaction.Run(
      "SELECT setval('session_epochs', newest) FROM (SELECT max(epoch) AS newest FROM "
      "session_states) AS found WHERE newest >= (SELECT last_value FROM session_epochs)",
      {});
}

absl::Status PreparePostgresSchema(PostgresPool* pool) {
  return pool->Run([&](PostgresTransaction& transaction) {
    return ChangeSchema(pool->target().name, transaction);
  });
}

}  // namespace tissueform
