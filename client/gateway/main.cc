// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <cstdio>
#include <ctime>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "CLI/CLI.hpp"
#include "grpc/support/log.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

#include "client/gateway/gateway.h"
#include "client/gateway/gateway_options.h"
#include "server/platform/log_lines.h"
#include "server/platform/program_options.h"
#include "server/platform/systemd_notices.h"

namespace {

constexpr char kDescription[] =
    "Serves the planner to browsers and passes their calls to tissueform-server: gRPC-Web "
    "and WebSockets (docs/gateway.md). Stores nothing.\n"
    "Prints `listening on URL` on stdout when it is ready; logs go to stderr.\n"
    "SIGTERM or SIGINT: notifies every client, exit code 0.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

enum ExitCode : int { kExitDone = 0, kExitFailed = 1 };

// Between two lines of the log that report the counts.
constexpr time_t kCountsSeconds = 60;

sigset_t TerminationSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  return signals;
}

void ServeUntilSignal(const tissueform::Gateway& gateway) {
  const sigset_t signals = TerminationSignals();
  const timespec interval = {kCountsSeconds, 0};
  std::string logged;
  while (sigtimedwait(&signals, nullptr, &interval) < 0) {
    std::string counts = gateway.counters().Text();
    if (counts != logged) spdlog::info("counts: {}", counts);
    logged = std::move(counts);
  }
}

ExitCode Serve(const tissueform::GatewayOptions& options) {
  const auto gateway = tissueform::Gateway::Start(options);
  if (!gateway.ok()) {
    std::fprintf(stderr, "tissueform-gateway: %s\n",
                 std::string(gateway.status().message()).c_str());
    return kExitFailed;
  }
  std::printf("listening on %s\n", (*gateway)->Url().c_str());
  std::fflush(stdout);
  const tissueform::SystemdWatchdog watchdog(
      [&gateway](std::function<void()> answered) { (*gateway)->Ask(std::move(answered)); });
  tissueform::NotifySystemdReady();
  ServeUntilSignal(**gateway);
  tissueform::NotifySystemdStopping();
  (*gateway)->Drain();
  spdlog::info("done; counts: {}", (*gateway)->counters().Text());
  return kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  // Before there are threads: they inherit it, and the signals wait for ServeUntilSignal.
  const sigset_t signals = TerminationSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  CLI::App app(kDescription, "tissueform-gateway");
  tissueform::GatewayOptions options;
  tissueform::AddGatewayOptions(app, &options);
  if (const std::optional<int> end = tissueform::ParseProgramOptions(app, argc, argv)) return *end;
  spdlog::set_default_logger(spdlog::stderr_color_mt("tissueform-gateway"));
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  tissueform::SetLogFormat(options.log_format);
  // What clients and servers do wrong comes back as a status.
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("gRPC: {}", args->message); });
  return Serve(options);
}
