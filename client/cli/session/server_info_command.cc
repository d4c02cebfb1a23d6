// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/server_info_command.h"

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "nlohmann/json.hpp"

#include "client/cli/session/server_connection.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct ServerInfoOptions {
  ServerConnection server;
  bool json = false;
};

std::vector<std::string> EncodingNames(const v1::ServerInfo& info) {
  std::vector<std::string> names;
  for (const int value : info.encodings()) {
    // One that this program does not know has no name.
    const std::string& name = v1::PositionEncoding_Name(static_cast<v1::PositionEncoding>(value));
    names.push_back(name.empty()
                        ? std::to_string(value)
                        : absl::AsciiStrToLower(absl::StripPrefix(name, "POSITION_ENCODING_")));
  }
  return names;
}

nlohmann::ordered_json InfoJson(const v1::ServerInfo& info) {
  nlohmann::ordered_json json = {{"version", info.version()},
                                 {"commit", info.commit()},
                                 {"api_version", info.api_version()},
                                 {"draining", info.draining()},
                                 {"encodings", EncodingNames(info)},
                                 {"models", nlohmann::ordered_json::array()},
                                 {"limits", nlohmann::ordered_json::object()}};
  for (const v1::ModelInfo& model : info.models()) {
    json["models"].push_back({{"name", model.name()},
                              {"iterates", model.iterates()},
                              {"has_prepared_answers", model.has_prepared_answers()}});
  }
  for (const v1::ServerLimit& limit : info.limits()) json["limits"][limit.name()] = limit.value();
  return json;
}

void PrintTable(const v1::ServerInfo& info) {
  constexpr char kRow[] = "%-28s %s\n";
  absl::PrintF(kRow, "version", info.version());
  absl::PrintF(kRow, "commit", info.commit());
  absl::PrintF(kRow, "protocol", info.api_version());
  absl::PrintF(kRow, "state", info.draining() ? "draining: accepts no new work" : "serving");
  absl::PrintF(kRow, "encodings", absl::StrJoin(EncodingNames(info), ", "));
  absl::PrintF("\n%-28s %-10s %s\n", "model", "iterates", "prepared answers");
  for (const v1::ModelInfo& model : info.models()) {
    absl::PrintF("%-28s %-10s %s\n", model.name(), model.iterates() ? "yes" : "no",
                 model.has_prepared_answers() ? "yes" : "no");
  }
  absl::PrintF("\n%-28s %s\n", "limit", "value");
  for (const v1::ServerLimit& limit : info.limits()) {
    absl::PrintF("%-28s %d\n", limit.name(), limit.value());
  }
}

absl::Status Run(const ServerInfoOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::ServerInfo info, client->GetServerInfo());
  if (options.json) {
    absl::PrintF("%s\n", InfoJson(info).dump(2));
  } else {
    PrintTable(info);
  }
  return absl::OkStatus();
}

}  // namespace

void AddServerInfoCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ServerInfoOptions>();
  CLI::App* command = app.add_subcommand(kServerInfoCommand.name, kServerInfoCommand.description);
  AddServerOption(command, &options->server);
  command->add_flag("--json", options->json, "print JSON instead of a table");
  command->footer("Example:\n  tissueform server-info --server localhost:50051");
  command->callback([options, work] { *work = [options] { return Run(*options); }; });
}

}  // namespace tissueform
