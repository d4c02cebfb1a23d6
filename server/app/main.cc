// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <signal.h>
#include <unistd.h>
#include <utility>

#include "CLI/CLI.hpp"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"
#include <sys/syscall.h>

#include "core/base/freed_memory.h"
#include "server/app/backup_commands.h"
#include "server/app/migrate_command.h"
#include "server/app/server_options.h"
#include "server/app/tissueform_server.h"
#include "server/platform/log_lines.h"
#include "server/platform/program_options.h"
#include "server/platform/systemd_notices.h"

namespace {

constexpr char kDescription[] =
    "Serves soft-tissue sessions over gRPC (package tissueform.v1).\n"
    "Prints `listening on HOST:PORT` on stdout when it is ready; logs go to stderr.\n"
    "SIGTERM or SIGINT: refuses new work, lets open calls finish, exit code 0.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

enum ExitCode : int { kExitDone = 0, kExitFailed = 1 };

constexpr uint64_t kTerminationSignals =
    (uint64_t{1} << (SIGTERM - 1)) | (uint64_t{1} << (SIGINT - 1));

// Blocks SIGTERM and SIGINT for every thread that there will be. In main() it would be too
// late: OpenBLAS starts threads when it is loaded, and a second signal, while the server drains,
// would end the process by one of them. Handlers would not do either: METIS takes SIGTERM for a
// jump of its own while it orders a matrix, and leaves a handler behind that lasts for one signal.
// The system call itself, as nothing is initialised yet that the sanitizers' wrappers need.
__attribute__((no_sanitize("address", "thread", "undefined"))) void BlockTerminationSignals() {
  syscall(SYS_rt_sigprocmask, SIG_BLOCK, &kTerminationSignals, nullptr,
          sizeof(kTerminationSignals));
}

// What stands here runs before the libraries' own initialisation.
__attribute__((section(".preinit_array"),
               used)) void (*const run_first)() = BlockTerminationSignals;

void WaitForTerminationSignal() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  int number = 0;
  sigwait(&signals, &number);
}

ExitCode Serve(const tissueform::ServerOptions& options) {
  const auto server = tissueform::TissueformServer::Start(options);
  if (!server.ok()) {
    std::fprintf(stderr, "tissueform-server: %s\n", std::string(server.status().message()).c_str());
    return kExitFailed;
  }
  std::printf("listening on %s:%d\n", options.host.c_str(), (*server)->port());
  std::fflush(stdout);
  const tissueform::SystemdWatchdog watchdog(
      [&server](std::function<void()> answered) { (*server)->Ask(std::move(answered)); });
  tissueform::NotifySystemdReady();
  WaitForTerminationSignal();
  tissueform::NotifySystemdStopping();
  (*server)->Drain();
  spdlog::info("done");
  return kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  tissueform::ReturnFreedMemory();
  std::signal(SIGPIPE, SIG_IGN);  // a closed pipe on stdout shall not end a server
  std::signal(SIGHUP, SIG_IGN);   // nor shall log rotation or a terminal that closes
  CLI::App app(kDescription, "tissueform-server");
  tissueform::ServerOptions options = tissueform::ServerOptions::Defaults();
  tissueform::AddServerOptions(app, &options);
  const tissueform::BackupCommands commands(app, &options);
  const tissueform::MigrateCommand migrate(app);
  if (const std::optional<int> end = tissueform::ParseProgramOptions(app, argc, argv)) return *end;
  if (const std::optional<int> end = commands.Run()) return *end;
  if (const std::optional<int> end = migrate.Run()) return *end;
  spdlog::set_default_logger(spdlog::stderr_color_mt("tissueform"));
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  tissueform::SetLogFormat(options.telemetry.log_format);
  return Serve(options);
}
