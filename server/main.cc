// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <cstdio>
#include <memory>
#include <signal.h>

#include "CLI/CLI.hpp"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

#include "core/base/freed_memory.h"
#include "server/server_options.h"
#include "server/tissueform_server.h"

namespace {

constexpr char kDescription[] =
    "Keeps soft-tissue sessions in memory and lends them over gRPC (package tissueform.v1).\n"
    "Prints `listening on HOST:PORT` on stdout when it is ready; logs go to stderr.\n"
    "SIGTERM or SIGINT: refuses new work, lets open calls finish, exit code 0.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

enum ExitCode : int { kExitDone = 0, kExitFailed = 1, kExitWrongUse = 2 };

// Blocked before any thread starts, so that all inherit it and only sigwait sees them.
sigset_t BlockTerminationSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

ExitCode Serve(const tissueform::ServerOptions& options, const sigset_t& signals) {
  const auto server = tissueform::TissueformServer::Start(options);
  if (!server.ok()) {
    std::fprintf(stderr, "tissueform-server: %s\n", std::string(server.status().message()).c_str());
    return kExitFailed;
  }
  std::printf("listening on %s:%d\n", options.host.c_str(), (*server)->port());
  std::fflush(stdout);
  int signal_number = 0;
  sigwait(&signals, &signal_number);
  (*server)->Drain();
  spdlog::info("done");
  return kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  tissueform::ReturnFreedMemory();
  const sigset_t signals = BlockTerminationSignals();
  std::signal(SIGPIPE, SIG_IGN);  // a closed pipe on stdout shall not end a server
  CLI::App app(kDescription, "tissueform-server");
  tissueform::ServerOptions options = tissueform::ServerOptions::Defaults();
  tissueform::AddServerOptions(app, &options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "tissueform-server: %s; see --help\n", error.what());
    return kExitWrongUse;
  }
  spdlog::set_default_logger(spdlog::stderr_color_mt("tissueform"));
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  return Serve(options, signals);
}
