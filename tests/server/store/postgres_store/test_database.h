// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "server/store/postgres_store/postgres_connection.h"
#include "server/store/postgres_store/postgres_options.h"
#include "server/store/postgres_store/postgres_stores.h"

// The PostgreSQL server that this test program was started with (pg_virtualenv sets PGHOST, PGPORT,
// PGUSER and PGPASSWORD). Tests that need a server are skipped without it.
namespace tissueform::testing {

bool HasTestDatabase();

// For one test: says why it is skipped.
#define TF_SKIP_WITHOUT_DATABASE()                                                           \
  if (!::tissueform::testing::HasTestDatabase()) {                                           \
    GTEST_SKIP()                                                                             \
        << "no PostgreSQL: run this program with pg_virtualenv (package postgresql-common)"; \
  }                                                                                          \
  static_assert(true)

// Of its database "postgres", or that of the name.
PostgresOptions TestDatabaseOptions(const std::string& name = "postgres");

int TestDatabasePort();

// Empties the database: no table of ours is left.
void EmptyTestDatabase();

// One or more statements in a transaction of their own; a test that cannot do so ends.
SqlRows RunSql(const std::string& sql);

// One statement that may not be in a transaction: CREATE DATABASE.
void RunOutsideTransaction(const std::string& sql);

// With the mesh that sample sessions are made from.
std::unique_ptr<PostgresStores> OpenTestStores(
    UnixClock clock = SystemUnixSeconds, const PostgresOptions& options = TestDatabaseOptions());

}  // namespace tissueform::testing
