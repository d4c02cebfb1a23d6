// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>

#include "server/store/sql_access_store.h"
#include "server/store/sql_case_store.h"
#include "server/store/sql_mesh_store.h"
#include "server/store/sql_session_store.h"
#include "server/store/sql_stores.h"

// Stores of a server that keeps nothing, one by one: calls are answered before they return.
namespace tissueform {

struct InMemoryBase {
  explicit InMemoryBase(UnixClock clock = SystemUnixSeconds)
      : stores(*OpenInMemoryStores(std::move(clock))) {}

  SqlDatabase* database() const { return &stores->database(); }
  SqlBlobs* blobs() const { return &static_cast<SqlStores&>(*stores).blobs(); }

  const std::unique_ptr<Stores> stores;
};

class InMemorySessionStore : private InMemoryBase, public SqlSessionStore {
 public:
  explicit InMemorySessionStore(UnixClock clock = SystemUnixSeconds)
      : InMemoryBase(clock), SqlSessionStore(database(), std::move(clock)) {}
};

class InMemoryMeshStore : private InMemoryBase, public SqlMeshStore {
 public:
  InMemoryMeshStore() : SqlMeshStore(database(), blobs()) {}
};

class InMemoryCaseStore : private InMemoryBase, public SqlCaseStore {
 public:
  InMemoryCaseStore() : SqlCaseStore(database(), blobs()) {}
};

class InMemoryAccessStore : private InMemoryBase, public SqlAccessStore {
 public:
  InMemoryAccessStore() : SqlAccessStore(InMemoryBase::database()) {}

  using InMemoryBase::database;
  using InMemoryBase::stores;
};

}  // namespace tissueform
