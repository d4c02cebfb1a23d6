// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_build_call.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <poll.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kProgram[] = "tissueform-plan-build";
constexpr int64_t kMaxThreads = 4096;

// An answer is stages, each after kStage, and at the end the outcome after kOutcome.
constexpr int64_t kOutcome = 0;
constexpr int64_t kStage = 1;
constexpr int64_t kFractionUnits = 1'000'000;

void SendRequest(const PlanBuildRequest& request, PipeSender* to) {
  for (const std::string& text : {request.ct, request.recipe, request.surfaces, request.labels,
                                  request.folder, request.folder_name}) {
    to->Text(text);
  }
  to->Number(request.threads);
  to->Number(request.pictures ? 1 : 0);
  to->Number(request.only_compare_labels ? 1 : 0);
  to->Number(request.only_write_inputs ? 1 : 0);
}

absl::StatusOr<PlanBuildRequest> ReceiveRequest(PipeReceiver* from) {
  PlanBuildRequest request;
  for (std::string* text : {&request.ct, &request.recipe, &request.surfaces, &request.labels,
                            &request.folder, &request.folder_name}) {
    TF_ASSIGN_OR_RETURN(*text, from->Text());
  }
  TF_ASSIGN_OR_RETURN(const int64_t threads, from->Number(kMaxThreads));
  TF_ASSIGN_OR_RETURN(const int64_t pictures, from->Number(1));
  TF_ASSIGN_OR_RETURN(const int64_t only_compare, from->Number(1));
  TF_ASSIGN_OR_RETURN(const int64_t only_inputs, from->Number(1));
  request.only_compare_labels = only_compare != 0;
  request.only_write_inputs = only_inputs != 0;
  request.threads = static_cast<int>(threads);
  request.pictures = pictures != 0;
  return request;
}

// OK when there is something to read from `answer`.
absl::Status WaitFor(int answer, int cancel) {
  std::array<pollfd, 2> watched = {pollfd{.fd = answer, .events = POLLIN, .revents = 0},
                                   pollfd{.fd = cancel, .events = POLLIN, .revents = 0}};
  while (poll(watched.data(), watched.size(), -1) < 0) {
    if (errno != EINTR) return absl::ErrnoToStatus(errno, "cannot wait for the plan");
  }
  // First: Ctrl-C shall end the work also while it sends one stage after the other.
  if (watched[1].revents != 0) return absl::CancelledError("the work was stopped");
  return absl::OkStatus();
}

absl::StatusOr<PlanBuildAnswer> ReceiveAnswer(int answer, const PlanBuildCallOptions& options) {
  PipeReceiver from(answer, std::numeric_limits<int64_t>::max());
  TF_RETURN_IF_ERROR(from.Outcome());  // whether it could begin
  for (;;) {
    TF_RETURN_IF_ERROR(WaitFor(answer, options.cancel));
    TF_ASSIGN_OR_RETURN(const int64_t kind, from.Number(kStage));
    if (kind == kOutcome) break;
    TF_ASSIGN_OR_RETURN(const std::string stage, from.Text());
    TF_ASSIGN_OR_RETURN(const int64_t done, from.Number(kFractionUnits));
    if (options.on_progress) options.on_progress(stage, static_cast<double>(done) / kFractionUnits);
  }
  TF_RETURN_IF_ERROR(from.Outcome());
  PlanBuildAnswer made;
  TF_ASSIGN_OR_RETURN(made.text, from.Text());
  TF_ASSIGN_OR_RETURN(const int64_t ready, from.Number(1));
  TF_ASSIGN_OR_RETURN(made.defects, from.Text());
  made.ready = ready != 0;
  return made;
}

absl::Status Explain(const ChildEnd& end) {
  if (end.signal == SIGKILL || end.signal == SIGXCPU) {
    return absl::ResourceExhaustedError(
        "the work was killed, possibly because memory ran out; no files were written");
  }
  return absl::InternalError(end.signal != 0 ? absl::StrCat("a library crashed (signal ",
                                                            end.signal, "); no files were written")
                                             : "a library ended the work; no files were written");
}

}  // namespace

absl::StatusOr<PlanBuildAnswer> CallPlanBuild(const PlanBuildRequest& request,
                                              const PlanBuildCallOptions& options) {
  PlanBuildAnswer made;
  TF_RETURN_IF_ERROR(CallHelper(
      {.program = kProgram,
       .what = "building the plan",
       .limits = request.limits,
       .explain = Explain},
      [&](PipeSender* to) { SendRequest(request, to); },
      [&](int answer) -> absl::Status {
        TF_ASSIGN_OR_RETURN(made, ReceiveAnswer(answer, options));
        return absl::OkStatus();
      }));
  return made;
}

int RunPlanBuildProgram(const PlanBuildWork& work) {
  return RunHelperProgram(
      [&work](const IsolationLimits& limits, PipeReceiver* from, PipeSender* answer) {
        answer->Outcome(absl::OkStatus());
        const auto on_stage = [answer](absl::string_view stage, double fraction) {
          answer->Number(kStage);
          answer->Text(stage);
          answer->Number(std::llround(fraction * kFractionUnits));
        };
        PlanBuildAnswer made;
        const absl::Status outcome =
            WithoutExceptions("building the plan", limits, [&]() -> absl::Status {
              TF_ASSIGN_OR_RETURN(const PlanBuildRequest request, ReceiveRequest(from));
              TF_ASSIGN_OR_RETURN(made, work(request, on_stage));
              return absl::OkStatus();
            });
        answer->Number(kOutcome);
        answer->Outcome(outcome);
        answer->Text(made.text);
        answer->Number(made.ready ? 1 : 0);
        answer->Text(made.defects);
      });
}

}  // namespace tissueform
