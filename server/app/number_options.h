// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "server/app/server_options.h"
#include "server/rpc/server_info_service.h"

namespace tissueform {

// A number of ServerOptions. One table of these gives the command line, and with it the
// environment, the file and --print-config; the limits of GetServerInfo; and the table in
// docs/server-options.md.
struct NumberOption {
  absl::string_view name;   // of the option, with its dashes; empty: a fixed limit
  absl::string_view limit;  // its name in GetServerInfo
  int64_t min = 0;          // what the command line accepts, in units of the option
  int64_t max = 0;
  absl::string_view help;  // ends without a full stop; states the unit where the name does not
  int64_t unit = 1;        // how many units of the member are one unit of the option (MiB: 2^20)
  int64_t info_unit = 1;  // how many units of GetServerInfo are one unit of the member (s: 1000 ms)

  // The member, in its own unit.
  int64_t (*get)(const ServerOptions& options);
  void (*set)(ServerOptions& options, int64_t value);
};

// All of them, in the order of --help.
const std::vector<NumberOption>& NumberOptions();

// Adds those that have a name. `options` must outlive `app`.
void AddNumberOptions(CLI::App& app, ServerOptions* options);

// gRPC's limit of one message from a client.
inline constexpr int kMaxReceiveBytes = 4 << 20;

// Memory of the sessions of one principal, where the option is 0, too.
int64_t MemoryQuota(const ServerOptions& options);

// Every limit that a client can meet: the table's, and the fixed ones of the transport.
NamedLimits LimitsOf(const ServerOptions& options);

// The rows of docs/server-options.md.
std::string NumberOptionRows();

}  // namespace tissueform
