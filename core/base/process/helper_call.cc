// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/helper_call.h"

#include <chrono>
#include <csignal>
#include <memory>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kEndGrace{10};
constexpr int kLoaderFailed = 127;  // what the dynamic loader ends a program with

absl::Status ExplainEnd(const HelperCall& call, const ChildEnd& end) {
  if (end.exit_code == kLoaderFailed) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the program ", call.program, " does not start; a library that it needs is missing"));
  }
  if (end.exit_code < 0 && end.signal == 0) {
    return absl::InternalError(
        absl::StrCat(call.what,
                     " ended early for an unknown reason: the system keeps no account "
                     "of children while SIGCHLD is ignored"));
  }
  if (call.explain) return call.explain(end);
  if (end.signal == SIGXCPU || end.signal == SIGKILL) {
    return absl::ResourceExhaustedError(absl::StrCat(
        call.what, " took more than ", call.limits.max_seconds, " seconds or all memory"));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("it is damaged: the library crashed while ", call.what));
}

absl::StatusOr<std::unique_ptr<ChildProcess>> Start(absl::string_view name) {
  ChildOptions options;
  TF_ASSIGN_OR_RETURN(options.program, FindProgram(name));
  options.input = ChildStream::Pipe();
  options.output = ChildStream::Pipe();
  // Ctrl-C is for the caller: a server that drains still needs its helpers, and any other program
  // takes them with it when it ends.
  options.own_group = true;
  return ChildProcess::Start(options);
}

}  // namespace

absl::Status CallHelper(const HelperCall& call,
                        const std::function<void(PipeSender* request)>& send,
                        const std::function<absl::Status(int descriptor)>& receive) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ChildProcess> helper, Start(call.program));
  PipeSender request(helper->request());
  request.Number(kHelperCallVersion);
  request.Number(call.limits.max_memory_bytes);
  request.Number(call.limits.max_seconds);
  request.Number(call.limits.max_file_bytes);
  send(&request);  // where that fails, how the helper ended says more
  const absl::Status received = receive(helper->answer());
  if (absl::IsDataLoss(received)) {
    // An answer without sense may come from a helper that still runs.
    const std::optional<ChildEnd> end = helper->WaitFor(kEndGrace);
    return ExplainEnd(call, end.value_or(ChildEnd{}));
  }
  return received;
}

}  // namespace tissueform
