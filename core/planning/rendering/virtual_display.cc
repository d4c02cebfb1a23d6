// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/virtual_display.h"

#include <chrono>
#include <cstdlib>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

// Last, and without its word for int: a macro that would change absl's.
#include <X11/Xlib.h>
#undef Status

namespace tissueform {
namespace {

constexpr int kStartMilliseconds = 20000;
constexpr std::chrono::seconds kEndGrace{5};

ChildOptions Xvfb() {
  ChildOptions options;
  options.program = "Xvfb";
  // It chooses a display and writes its number to stdout.
  options.arguments = {"-displayfd",   "1",         "-screen", "0",
                       "1280x1024x24", "-nolisten", "tcp",     "-noreset"};
  options.output = ChildStream::Pipe();
  options.errors = ChildStream::Null();
  return options;
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

}  // namespace

bool DisplayOpens() {
  Display* display = XOpenDisplay(nullptr);
  if (display == nullptr) return false;
  XCloseDisplay(display);
  return true;
}

absl::StatusOr<std::unique_ptr<VirtualDisplay>> VirtualDisplay::Open() {
  std::unique_ptr<VirtualDisplay> display(new VirtualDisplay());
  if (!DisplayOpens()) {
    TF_RETURN_IF_ERROR(display->Start());
  }
  return display;
}

absl::Status VirtualDisplay::Start() {
  absl::StatusOr<std::unique_ptr<GuardedProgram>> server = GuardedProgram::Start(Xvfb(), kEndGrace);
  if (absl::IsNotFound(server.status())) {
    return absl::NotFoundError(
        "pictures need an X display or the program Xvfb; install the package xvfb");
  }
  TF_RETURN_IF_ERROR(server.status());
  int number = 0;
  if (!absl::SimpleAtoi(ReadLine((*server)->answer()), &number)) {
    return absl::UnavailableError(
        "Xvfb does not start; run it by hand (Xvfb :99), or set DISPLAY to a usable display");
  }
  if (const char* former = std::getenv("DISPLAY")) former_display_ = former;
  server_ = *std::move(server);
  setenv("DISPLAY", absl::StrCat(":", number).c_str(), 1);
  return absl::OkStatus();
}

VirtualDisplay::~VirtualDisplay() {
  if (server_ == nullptr) return;
  if (former_display_.has_value()) {
    setenv("DISPLAY", former_display_->c_str(), 1);
  } else {
    unsetenv("DISPLAY");
  }
}

}  // namespace tissueform
