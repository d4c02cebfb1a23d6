// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/rendering/virtual_display.h"

#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include <sys/prctl.h>
#include <sys/wait.h>

#include "client/rendering/display_check.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kStartMilliseconds = 20000;
constexpr int kNoSuchProgram = 127;

// In the child: becomes Xvfb, which writes the number of the display it chose to `descriptor`.
[[noreturn]] void RunXvfb(int descriptor) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);  // no server is left behind when this program is killed
  const int nowhere = open("/dev/null", O_RDWR);
  dup2(nowhere, STDIN_FILENO);
  dup2(nowhere, STDOUT_FILENO);
  dup2(nowhere, STDERR_FILENO);
  const std::string number = std::to_string(descriptor);
  execlp("Xvfb", "Xvfb", "-displayfd", number.c_str(), "-screen", "0", "1280x1024x24", "-nolisten",
         "tcp", "-noreset", nullptr);
  _exit(kNoSuchProgram);
}

// What arrives up to the end of the line; empty when the other end closes or nothing comes in time.
std::string ReadLine(int descriptor) {
  std::string line;
  pollfd readable{descriptor, POLLIN, 0};
  char next = 0;
  while (poll(&readable, 1, kStartMilliseconds) > 0 && read(descriptor, &next, 1) == 1) {
    if (next == '\n') return line;
    line += next;
  }
  return "";
}

absl::Status StartError(pid_t server) {
  int status = 0;
  kill(server, SIGKILL);
  waitpid(server, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoSuchProgram) {
    return absl::NotFoundError(
        "pictures need an X display or the program Xvfb; install the package xvfb");
  }
  return absl::UnavailableError(
      "Xvfb does not start; try it by hand (Xvfb :99) or set DISPLAY to a usable display");
}

}  // namespace

absl::StatusOr<std::unique_ptr<VirtualDisplay>> VirtualDisplay::Open() {
  std::unique_ptr<VirtualDisplay> display(new VirtualDisplay());
  if (!DisplayOpens()) {
    TF_RETURN_IF_ERROR(display->Start());
  }
  return display;
}

absl::Status VirtualDisplay::Start() {
  int ends[2];
  if (pipe(ends) != 0) return absl::UnavailableError("cannot make a pipe for Xvfb");
  // The child's end must stay open over exec; ours must not, or the end of the child goes unseen.
  fcntl(ends[0], F_SETFD, FD_CLOEXEC);
  const pid_t server = fork();
  if (server < 0) return absl::UnavailableError("cannot start a process for Xvfb");
  if (server == 0) RunXvfb(ends[1]);
  close(ends[1]);
  const std::string number = ReadLine(ends[0]);
  close(ends[0]);
  int parsed = 0;
  if (!absl::SimpleAtoi(number, &parsed)) return StartError(server);
  if (const char* former = std::getenv("DISPLAY")) {
    had_display_ = true;
    former_display_ = former;
  }
  server_ = server;
  setenv("DISPLAY", absl::StrCat(":", parsed).c_str(), 1);
  return absl::OkStatus();
}

VirtualDisplay::~VirtualDisplay() {
  if (server_ == 0) return;
  kill(server_, SIGTERM);
  waitpid(server_, nullptr, 0);
  if (had_display_) {
    setenv("DISPLAY", former_display_.c_str(), 1);
  } else {
    unsetenv("DISPLAY");
  }
}

}  // namespace tissueform
