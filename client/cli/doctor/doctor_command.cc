// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/doctor_command.h"

#include <chrono>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/doctor/doctor_calls.h"
#include "client/cli/doctor/tcp_probe.h"
#include "client/cli/doctor/tls_probe.h"
#include "client/cli/doctor/token_words.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/server_channel.h"

namespace tissueform {
namespace {

struct DoctorOptions {
  ServerConnection server = {};
  bool json = false;
};

// Down to the port and its encryption. False: nothing can be called.
bool AskNetwork(const ServerConnection& server, const ConnectionOptions& options,
                DoctorReport* report) {
  const auto endpoint = ParseEndpoint(server.address);
  if (!endpoint.ok()) {
    report->Add({.check = "name",
                 .finding = Finding::kFailed,
                 .text = std::string(endpoint.status().message())});
    return false;
  }
  for (const auto check : {CheckName, CheckRoute}) {
    report->Add(check(*endpoint));
    if (report->last_failed()) return false;
  }
  report->Add(options.encrypted() ? CheckTls(*endpoint, options) : CheckPlain(*endpoint));
  return !report->last_failed();
}

absl::Status Run(const DoctorOptions& options) {
  const DoctorReport report = AskDoctor(options.server);
  if (options.json) {
    absl::PrintF("%s\n", report.Json(options.server.address).dump(2));
  } else {
    absl::PrintF("%s", report.Text());
  }
  if (report.failed()) {
    return absl::UnavailableError(
        absl::StrCat(options.server.address, " cannot be used from here as configured"));
  }
  return absl::OkStatus();
}

}  // namespace

DoctorReport AskDoctor(const ServerConnection& server) {
  DoctorReport report;
  const ConnectionOptions options = ResolveConnection(server);
  if (!AskNetwork(server, options, &report)) return report;
  report.Add(CheckToken(options, std::chrono::system_clock::now()));
  if (report.last_failed()) return report;
  const auto token = OpenTokenOf(options);
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  const auto channel =
      MakeServerChannel(server.address, options, token.ok() ? *token : nullptr, arguments);
  if (!channel.ok()) {
    report.Add({.check = "health",
                .finding = Finding::kFailed,
                .text = std::string(channel.status().message())});
    return report;
  }
  DoctorCalls calls(*channel);
  report.Add(calls.CheckHealth());
  if (report.last_failed()) return report;
  if (!calls.CheckCaller(&report)) return report;
  calls.CheckServer(&report);
  if (!report.failed()) report.Add(calls.CheckWork());
  return report;
}

void AddDoctorCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* command = app.add_subcommand(kDoctorCommand.name, kDoctorCommand.description);
  command->add_option("SERVER", options->server.address, "address of the server, HOST:PORT")
      ->required();
  AddConnectionOptions(command, &options->server.options);
  command->add_flag("--json", options->json, "print JSON instead of lines");
  command->footer(
      "Each line reports ok or what to do. Exit code 1 if a check failed.\n\n"
      "Example:\n"
      "  tissueform doctor planner.example.org:50051 --tls-ca hospital-ca.pem");
  command->callback([options, work] { *work = [options] { return Run(*options); }; });
}

}  // namespace tissueform
