// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/postgres_store/test_database.h"

#include <cstdlib>
#include <functional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"

namespace tissueform::testing {
namespace {

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

PostgresConnection& AdministratorsConnection() {
  static const auto* const connection = new std::unique_ptr<PostgresConnection>(
      *PostgresConnection::Open(*TargetOf(TestDatabaseOptions())));
  return **connection;
}

void RunOrEnd(const std::string& sql,
              const std::function<absl::Status(PostgresTransaction&)>& work) {
  PostgresOutcome outcome = PostgresOutcome::kFailed;
  const absl::Status status = AdministratorsConnection().Transact(work, &outcome);
  if (status.ok()) return;
  absl::FPrintF(stderr, "%s: %s\n", sql, status.ToString());
  std::abort();
}

}  // namespace

bool HasTestDatabase() { return !Environment("PGPORT").empty(); }

int TestDatabasePort() { return std::atoi(Environment("PGPORT").c_str()); }

PostgresOptions TestDatabaseOptions(const std::string& name) {
  return {.url = absl::StrCat("postgresql://", Environment("PGUSER"), "@", Environment("PGHOST"),
                              ":", Environment("PGPORT"), "/", name),
          .password = Environment("PGPASSWORD")};
}

SqlRows RunSql(const std::string& sql) {
  SqlRows rows;
  RunOrEnd(sql, [&](PostgresTransaction& transaction) -> absl::Status {
    if (sql.find(';') != std::string::npos) return transaction.Execute(sql);
    TF_ASSIGN_OR_RETURN(rows, transaction.Query(sql.c_str(), {}));
    return absl::OkStatus();
  });
  return rows;
}

void RunOutsideTransaction(const std::string& sql) {
  RunOrEnd(sql, [&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(transaction.Execute("COMMIT"));
    return transaction.Execute(sql);
  });
}

void EmptyTestDatabase() { RunSql("DROP SCHEMA public CASCADE; CREATE SCHEMA public;"); }

namespace {

// Of the name that the contract's sessions are made from, without its bytes; no list shows it.
void PutMeshOfContract() {
  const std::string name(64, 'f');
  RunSql(absl::StrCat("INSERT INTO blobs (sha256, bytes) VALUES ('", name,
                      "', 0); INSERT INTO meshes (sha256, record, last_used_s) VALUES ('", name,
                      "', '', 4000000000);"));
}

}  // namespace

std::unique_ptr<PostgresStores> OpenTestStores(UnixClock clock, const PostgresOptions& options) {
  auto stores = *PostgresStores::Open({.database = options, .clock = std::move(clock)});
  const MeshPayload mesh = SamplePayload(1);
  if (!stores->meshes().Put(RecordOf(mesh), mesh.View()).ok()) std::abort();
  return stores;
}

}  // namespace tissueform::testing

namespace tissueform {

// Where there is no database there are no stores to instantiate them with.
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(AccessQueriesTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(AccessStoreContractTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(CaseStoreContractTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ExportStoreContractTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MeshStoreContractTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(PredictionStoreContractTest);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SessionStoreContractTest);

// What the contract's tests of tests/server/store are run with here.
std::vector<StoresCase> AllStores() {
  if (!testing::HasTestDatabase()) return {};
  return {{"Postgres", [](UnixClock clock) {
             testing::EmptyTestDatabase();
             auto stores = *PostgresStores::Open(
                 {.database = testing::TestDatabaseOptions(), .clock = std::move(clock)});
             testing::PutMeshOfContract();
             return stores;
           }}};
}

}  // namespace tissueform
