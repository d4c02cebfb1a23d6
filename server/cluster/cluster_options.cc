// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/cluster_options.h"

#include <algorithm>
#include <array>
#include <unistd.h>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

#include "core/base/random_id.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxHostNameBytes = 48;
constexpr int kNodeConnections = 8;

bool MayStandInName(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.' ||
         c == ':';
}

}  // namespace

void AddClusterOptions(CLI::App& app, ClusterOptions* options, CLI::Option* data_dir,
                       CLI::Option* in_memory) {
  CLI::Option* store =
      app.add_option("--store", options->store,
                     "shared PostgreSQL database of several servers, postgresql://user@host:port/"
                     "name, instead of a data folder: this server becomes a node of a cluster")
          ->type_name("URL")
          ->excludes(data_dir)
          ->excludes(in_memory);
  app.add_option("--store-password-file", options->password_file,
                 "file with the database's password, readable by its owner only "
                 "(default: the environment's TISSUEFORM_STORE_PASSWORD)")
      ->type_name("FILE")
      ->needs(store);
  app.add_option("--node-name", options->node_name,
                 "name of this server in its cluster, used by clients and proxies "
                 "(default: the machine's name and the port)")
      ->type_name("NAME")
      ->needs(store)
      ->check([](const std::string& name) { return std::string(CheckNodeName(name).message()); });
}

absl::Status CheckNodeName(const std::string& name) {
  if (!name.empty() && name.size() <= kMaxNodeNameBytes &&
      std::all_of(name.begin(), name.end(), MayStandInName)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("not a valid node name: use 1 to ",
                                                 kMaxNodeNameBytes,
                                                 " letters, digits, \"-\", \"_\", \".\" or \":\""));
}

std::string DefaultNodeName(int port) {
  std::array<char, 256> host{};
  std::string name = gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "";
  std::erase_if(name, [](char c) { return !MayStandInName(c); });
  if (name.empty()) name = "node";
  return absl::StrCat(name.substr(0, kMaxHostNameBytes), ":",
                      port != 0 ? absl::StrCat(port) : RandomId().substr(0, 8));
}

absl::StatusOr<PostgresOptions> StoreOptionsOf(const ClusterOptions& options) {
  PostgresOptions store = options.limits;
  store.url = options.store;
  TF_ASSIGN_OR_RETURN(store.password, ReadPostgresPassword(options.password_file));
  return store;
}

PostgresOptions NodeOptionsOf(PostgresOptions store) {
  store.max_connections = kNodeConnections;
  store.connect_timeout = std::chrono::seconds(2);
  store.statement_timeout = std::chrono::milliseconds(1'500);
  store.lock_timeout = std::chrono::milliseconds(1'000);
  store.unanswered_timeout = std::chrono::milliseconds(2'000);
  store.patience = std::chrono::milliseconds(1'000);
  store.waited = nullptr;
  return store;
}

}  // namespace tissueform
