// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

// Which database, and how long is waited for it.
struct PostgresOptions {
  // postgresql://user@host:port/name, with what libpq knows behind a "?" (sslmode, sslrootcert).
  std::string url = {};
  // Never in the URL, which stands on command lines; never in a message.
  std::string password = {};
  int max_connections = 8;
  // Until a connection stands.
  std::chrono::seconds connect_timeout{5};
  // The database ends a statement that takes longer.
  std::chrono::milliseconds statement_timeout{20'000};
  // The database ends a statement that waits longer for what another one has locked.
  std::chrono::milliseconds lock_timeout{10'000};
  // The database ends a transaction between whose statements so much time passes, and releases
  // what it has locked. Shorter than a lease: a server that stops or is cut off between a write
  // and its commit does not keep others from taking its sessions.
  std::chrono::milliseconds idle_timeout{3'000};
  // Without any answer to a statement for so long the connection is given up: the database ends
  // what takes too long, so it, or what lies between, is gone. Longer than the other two.
  std::chrono::milliseconds unanswered_timeout{25'000};
  // What a call waits for a free connection, and for a database that is not there: then it is
  // answered UNAVAILABLE.
  std::chrono::milliseconds patience{30'000};
  // Of that, what the call whose work this thread does has waited already, for a thread above all.
  std::function<std::chrono::steady_clock::duration()> waited = nullptr;
};

// What libpq connects with.
struct PostgresTarget {
  std::string connection;  // keywords and values; holds the password
  std::string name;        // "postgresql://host:port/name": for messages
};

// Reads the URL. A host elsewhere is asked for its certificate (sslmode=verify-full) unless the URL
// says an sslmode; "allow" and "prefer", which do not guarantee encryption, are refused. Of several
// hosts the one that takes writes is chosen, unless it says target_session_attrs.
//
// Errors: InvalidArgument (no such URL; a password in it; such an sslmode; a number below 1).
absl::StatusOr<PostgresTarget> TargetOf(const PostgresOptions& options);

// The password: what stands in the file without the line's end; where no file is named what stands
// in the environment variable TISSUEFORM_STORE_PASSWORD, or nothing.
//
// Errors: FailedPrecondition (other users may read the file), or what the disk says.
absl::StatusOr<std::string> ReadPostgresPassword(const std::string& file);

}  // namespace tissueform
