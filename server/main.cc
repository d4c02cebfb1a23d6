// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <memory>
#include <semaphore.h>
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

// How often the server was told to end. Handlers and a semaphore, instead of blocked signals and
// sigwait: OpenBLAS starts threads before main(), which would not have the signals blocked, and a
// second one, while the server drains, would end the process by them.
sem_t told_to_end;

void NoteSignal(int /*number*/) {
  const int saved_errno = errno;
  sem_post(&told_to_end);
  errno = saved_errno;
}

void CatchTerminationSignals() {
  sem_init(&told_to_end, 0, 0);
  struct sigaction action {};
  action.sa_handler = NoteSignal;
  action.sa_flags = SA_RESTART;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
}

void WaitForTerminationSignal() {
  while (sem_wait(&told_to_end) != 0 && errno == EINTR) {
  }
}

ExitCode Serve(const tissueform::ServerOptions& options) {
  const auto server = tissueform::TissueformServer::Start(options);
  if (!server.ok()) {
    std::fprintf(stderr, "tissueform-server: %s\n", std::string(server.status().message()).c_str());
    return kExitFailed;
  }
  std::printf("listening on %s:%d\n", options.host.c_str(), (*server)->port());
  std::fflush(stdout);
  WaitForTerminationSignal();
  (*server)->Drain();
  spdlog::info("done");
  return kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  tissueform::ReturnFreedMemory();
  CatchTerminationSignals();
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
  return Serve(options);
}
