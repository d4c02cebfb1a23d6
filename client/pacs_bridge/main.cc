// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <cstdint>
#include <optional>
#include <signal.h>
#include <unistd.h>

#include "CLI/CLI.hpp"
#include "grpc/support/log.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"
#include <sys/stat.h>
#include <sys/syscall.h>

#include "client/pacs_bridge/bridge_commands.h"
#include "client/pacs_bridge/bridge_options.h"
#include "server/platform/log_lines.h"
#include "server/platform/program_options.h"

namespace {

constexpr char kDescription[] =
    "Receives head CTs from a PACS, makes cases for the planner, and stores predictions in "
    "the patient's study (docs/pacs.md).\n"
    "Start with: tissueform-pacs run --allow-ae SCANNER --recipe recipe.json --server "
    "localhost:50051 --pacs pacs:104 --pacs-ae-title PACS\n"
    "SIGTERM or SIGINT: run and listen end between two steps, with exit code 0, the others at "
    "once; "
    "their work can be repeated.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

constexpr char kFooter[] =
    "What a person does by hand (not while `run` works on the same --state-dir, but status and "
    "series):\n"
    "  tissueform-pacs fetch STUDY            request a study from the PACS\n"
    "  tissueform-pacs series                 received series, and why each was chosen or not\n"
    "  tissueform-pacs build SERIES           make a plan regardless of the rules\n"
    "  tissueform-pacs publish SERIES         publish its case to the server\n"
    "  tissueform-pacs store EXPORT           show its patient; with --confirm-patient, store it\n"
    "  tissueform-pacs status --json          status of the queue\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

constexpr uint64_t kEndingSignals = (uint64_t{1} << (SIGTERM - 1)) | (uint64_t{1} << (SIGINT - 1));

// For every thread that there will be, and before libraries start theirs when they are loaded
// (OpenBLAS does). The system call itself, as nothing is initialised yet that the sanitizers'
// wrappers need.
__attribute__((no_sanitize("address", "thread", "undefined"))) void BlockEndingSignals() {
  syscall(SYS_rt_sigprocmask, SIG_BLOCK, &kEndingSignals, nullptr, sizeof(kEndingSignals));
}

__attribute__((section(".preinit_array"), used)) void (*const block_first)() = BlockEndingSignals;

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  umask(S_IRWXG | S_IRWXO);  // nothing that the bridge writes is for others
  CLI::App app(kDescription, "tissueform-pacs");
  tissueform::BridgeOptions options;
  tissueform::AddBridgeOptions(app, &options);
  const tissueform::BridgeCommands commands(app, &options);
  app.footer(kFooter);
  if (const std::optional<int> end = tissueform::ParseProgramOptions(app, argc, argv)) return *end;
  spdlog::set_default_logger(spdlog::stderr_color_mt("tissueform-pacs"));
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  tissueform::SetLogFormat(options.log_format);
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("gRPC: {}", args->message); });
  return commands.Run();
}
