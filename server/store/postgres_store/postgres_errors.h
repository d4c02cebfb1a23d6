// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// What libpqxx throws, as a Status: one line, which names the database and no value, and is for the
// log; clients receive a sentence of our own.
namespace tissueform {

// What a statement or a connection has failed with.
struct PostgresFailure {
  absl::Status status;
  bool transient = false;  // as PostgresOutcome
  bool connected = true;   // whether the connection is of use still
};

// Of what is being caught; by SQLSTATE. `name` is that of the database.
PostgresFailure FailureOfCaught(const std::string& name);

// Whether that is UNAVAILABLE for what others do with the same rows: the database is there.
bool OthersHoldRows(const absl::Status& status);

// Of a connection that could not be made, for which there is no SQLSTATE.
absl::Status ConnectError(const std::string& name, absl::string_view what);

}  // namespace tissueform
