// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_options.h"
#include "server/store/postgres_store/session_leases.h"

namespace tissueform {

// What makes a server a node of a cluster: the database that it shares with others.
struct ClusterOptions {
  std::string store = {};  // postgresql://user@host:port/name; empty: no cluster
  // Else the environment's TISSUEFORM_STORE_PASSWORD.
  std::string password_file = {};
  std::string node_name = {};  // empty: DefaultNodeName

  // No options of the program.
  std::chrono::milliseconds start_patience{30'000};  // a start waits so long for the database
  PostgresOptions limits = {};                       // of the database; without an address
  LeaseOptions lease = {};
  std::chrono::milliseconds renew_every{3'000};

  bool enabled() const { return !store.empty(); }
};

// `data_dir` and `in_memory` are the options that say where a server keeps things otherwise: they
// and --store exclude each other.
void AddClusterOptions(CLI::App& app, ClusterOptions* options, CLI::Option* data_dir,
                       CLI::Option* in_memory);

inline constexpr int kMaxNodeNameBytes = 64;

// Letters, digits, "-", "_", "." and ":", at most kMaxNodeNameBytes. Errors: InvalidArgument.
absl::Status CheckNodeName(const std::string& name);

// The machine's name and the port; where that is any free one, a random number in its place.
std::string DefaultNodeName(int port);

// Of the pool that answers calls. Errors: those of ReadPostgresPassword.
absl::StatusOr<PostgresOptions> StoreOptionsOf(const ClusterOptions& options);

// Of the pool that leases, the table of nodes and lookups of single rows have for themselves: a
// lease is renewed even while calls wait, and a request without an answer is given up while there
// is still time for another try.
PostgresOptions NodeOptionsOf(PostgresOptions store);

}  // namespace tissueform
