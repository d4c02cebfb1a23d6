// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/drag_command.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"

#include "client/cli/session/drag.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/session/session_wait.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/stats_json.h"
#include "client/cli/shared/uncertainty_text.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/reattaching_stream.h"
#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/planning/plan_io.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/material_conversion.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

struct DragCommandOptions {
  std::string plan;
  PlanReadOptions reading;
  ServerConnection server;
  double seconds = 20;
  double poses_per_second = 30;
  double give_up_seconds = 60;
  bool local = false;
};

// To the planned pose and back: the hand lifts at both ends, and what it has reached is committed.
constexpr double kSecondsThere = 2;

std::atomic<bool> interrupted = false;  // NOLINT: a signal has nowhere else to write

struct DragTotals {
  std::vector<double> latencies_ms;
  SteadyClock::time_point detached_at;
  double longest_away_seconds = 0;
  int64_t not_reached = 0;  // final answers that had not converged
  std::string last_not_reached;
  double largest_band_mm = 0;  // of all frames and vertices
};

void Note(const v1::DeformFrame& frame, double latency_ms, DragTotals* totals) {
  totals->latencies_ms.push_back(latency_ms);
  const std::string& bytes = frame.uncertainty_p95_mm();
  if (const auto band = FloatsFromBytes(bytes, static_cast<Eigen::Index>(bytes.size() / 4));
      band.ok() && band->size() > 0) {
    totals->largest_band_mm = std::max(totals->largest_band_mm, double{band->maxCoeff()});
  }
  const SolveSummary summary = ToSolveSummary(frame.summary());
  if (frame.refining() || summary.cancelled || summary.prepared) return;
  if (std::string text = NotReachedText(summary); !text.empty()) {
    ++totals->not_reached;
    totals->last_not_reached = std::move(text);
  }
}

// Reports what happens to the connection, on the receiving thread.
ReattachingStream::Options StreamOptions(const PlanProblem& problem,
                                         const DragCommandOptions& options, DragTotals* totals) {
  ReattachingStream::Options stream;
  stream.stream.vertices.kind = AnswerVertices::Kind::kSkin;
  if (HasPreparedAnswers(problem.deformer, problem.constraints))
    stream.stream.prepared = PreparedAnswersOf(problem);
  stream.reattachment.give_up_after =
      std::chrono::milliseconds(static_cast<int64_t>(1e3 * options.give_up_seconds));
  stream.stream.on_notice = [](const v1::DeformNotice& notice) {
    if (notice.has_draining()) absl::PrintF("the server is shutting down\n");
    if (notice.has_evicted())
      absl::PrintF("the session was evicted from the server's memory ...\n");
    if (notice.has_restored()) absl::PrintF("... and is back\n");
    if (notice.has_followers()) absl::PrintF("watched by %d\n", notice.followers().count());
    if (notice.has_committed() && !notice.committed().failure().empty()) {
      absl::PrintF("pose %d was not stored: %s\n", notice.committed().sequence(),
                   notice.committed().failure());
    }
  };
  stream.reattachment.on_detached = [totals](const absl::Status& why) {
    totals->detached_at = SteadyClock::now();
    absl::PrintF("%s\n", DetachedText(why));
  };
  stream.reattachment.on_reattached = [totals] {
    const double away =
        std::chrono::duration<double>(SteadyClock::now() - totals->detached_at).count();
    totals->longest_away_seconds = std::max(totals->longest_away_seconds, away);
    absl::PrintF("reattached after %.1f s\n", away);
  };
  return stream;
}

// Poses that this command answers itself beside the server; the sending thread's while it runs.
struct LocalAnswers {
  std::unique_ptr<PreparedEvaluator> evaluator;  // null: none are
  std::vector<double> times_ms;                  // of those that were covered
  int64_t beyond = 0;
};

absl::StatusOr<LocalAnswers> FetchLocalAnswers(TissueformClient* client, const std::string& session,
                                               const DeformStream::Options& stream) {
  if (!stream.prepared.has_value()) {
    return absl::InvalidArgumentError("the plan's model has no prepared answers; omit --local");
  }
  LocalAnswers local;
  TF_ASSIGN_OR_RETURN(const v1::Session described, client->GetSession(session));
  TF_ASSIGN_OR_RETURN(local.evaluator, client->FetchPreparedAnswers(described, stream));
  absl::PrintF("also answered locally: %d columns, %.2f MB\n", local.evaluator->header().terms(),
               1e-6 * static_cast<double>(local.evaluator->header().total_bytes()));
  return local;
}

void AnswerHere(const std::vector<NamedPose>& poses, LocalAnswers* local) {
  if (local->evaluator == nullptr) return;
  const Stopwatch watch;
  const auto answer = local->evaluator->Evaluate(poses);
  if (answer.ok() && answer->has_value()) {
    local->times_ms.push_back(1e3 * watch.Seconds());
  } else {
    ++local->beyond;
  }
}

void Send(ReattachingStream* drag, const std::vector<NamedPose>& poses,
          const DragCommandOptions& options, const Stopwatch& since_start, SendTimes* send_times,
          LocalAnswers* local, const std::atomic<bool>& ended) {
  const auto count = static_cast<uint64_t>(options.seconds * options.poses_per_second);
  const auto poses_there =
      std::max<uint64_t>(1, static_cast<uint64_t>(kSecondsThere * options.poses_per_second));
  const SteadyClock::time_point start = SteadyClock::now();
  for (uint64_t i = 0; i <= count && !ended && !interrupted; ++i) {
    std::this_thread::sleep_until(
        start + std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(
                    static_cast<double>(i) / options.poses_per_second)));
    const double phase = M_PI * static_cast<double>(i) / static_cast<double>(poses_there);
    send_times->Append(1e3 * since_start.Seconds());
    const std::vector<NamedPose> now = PartOfPoses(poses, (1 - std::cos(phase)) / 2);
    drag->SendPoses(i, now, /*commit=*/i % poses_there == 0 || i == count);
    AnswerHere(now, local);
  }
  drag->CloseSending();
}

void PrintTotals(const ReattachingStream& drag, const SendTimes& send_times,
                 const DragTotals& totals) {
  absl::PrintF("%d poses, %d frames", send_times.size(), totals.latencies_ms.size());
  if (!totals.latencies_ms.empty()) {
    absl::PrintF("; from a pose to its frame %.1f ms (p50), %.1f ms (p99)",
                 Percentile(totals.latencies_ms, 50), Percentile(totals.latencies_ms, 99));
  }
  absl::PrintF("; reattached %d times, disconnected for at most %.1f s", drag.reattachments(),
               totals.longest_away_seconds);
  if (const auto committed = drag.last_committed(); committed.has_value()) {
    absl::PrintF("; committed up to pose %d", *committed);
  }
  absl::PrintF("\n");
  if (totals.largest_band_mm > 0) {
    absl::PrintF("%s\n", LargestBandText(totals.largest_band_mm));
  }
  if (totals.not_reached > 0) {
    absl::FPrintF(stderr, "warning: %d answers do not meet the requirements; the last: %s\n",
                  totals.not_reached, totals.last_not_reached);
  }
}

void PrintLocal(const LocalAnswers& local) {
  if (local.evaluator == nullptr) return;
  absl::PrintF("answered locally: %d poses, %d beyond the prepared range", local.times_ms.size(),
               local.beyond);
  if (!local.times_ms.empty()) {
    absl::PrintF("; %.2f ms (p50), %.2f ms (p99)", Percentile(local.times_ms, 50),
                 Percentile(local.times_ms, 99));
  }
  absl::PrintF("\n");
}

absl::Status Drag(TissueformClient* client, const PlanProblem& problem,
                  const DragCommandOptions& options) {
  DragTotals totals;
  const ReattachingStream::Options stream = StreamOptions(problem, options, &totals);
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PlanSession> own,
                      MakePlanSession(client, problem, &interrupted, &stream.stream));
  const std::string& session = own->name();
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ReattachingStream> drag,
                      ReattachingStream::Open(client, session, stream));
  absl::PrintF(
      "dragging %s, %d vertices per frame; kill and restart the server to see the "
      "drag continue\n",
      session, drag->started().vertex_count());
  LocalAnswers local;
  if (options.local) {
    TF_ASSIGN_OR_RETURN(local, FetchLocalAnswers(client, session, stream.stream));
  }
  const Stopwatch since_start;
  SendTimes send_times;
  std::atomic<bool> ended = false;
  std::thread sender([&] {
    Send(drag.get(), NamedPoses(problem), options, since_start, &send_times, &local, ended);
  });
  while (std::optional<v1::DeformFrame> frame = drag->Receive()) {
    drag->Ack(*frame);
    Note(*frame, 1e3 * since_start.Seconds() - send_times.Get(frame->sequence()), &totals);
    if (interrupted) drag->Cancel();
  }
  ended = true;
  sender.join();
  PrintTotals(*drag, send_times, totals);
  PrintLocal(local);
  const absl::Status end = drag->Finish();
  return interrupted ? absl::CancelledError("interrupted") : end;
}

absl::Status Run(const DragCommandOptions& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // seen at once, also through a pipe
  struct sigaction action = {};
  action.sa_handler = [](int) { interrupted = true; };
  sigaction(SIGINT, &action, nullptr);
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.plan, options.reading));
  TF_RETURN_IF_ERROR(CheckSeal(options.plan, options.reading.resolve, plan));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client, ConnectTo(options.server));
  return Drag(client.get(), problem, options);
}

}  // namespace

void AddDragCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<DragCommandOptions>();
  CLI::App* command = app.add_subcommand(kDragCommand.name, kDragCommand.description);
  command->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  AddServerOption(command, &options->server);
  command->add_option("--seconds", options->seconds, "duration")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  command->add_option("--rate", options->poses_per_second, "poses per second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--reconnect-timeout", options->give_up_seconds,
                   "seconds to wait for an unreachable server")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  command->add_flag("--local", options->local,
                    "fetch the prepared answers and also answer every pose locally");
  AddPlanOptions(command, &options->reading, LipSealUse::kComputed);
  command->footer(
      "Example:\n"
      "  tissueform-server --port 50051 &\n"
      "  tissueform drag tests/data/plans/head/plan.json --server localhost:50051");
  command->callback([options, work] { *work = [options] { return Run(*options); }; });
}

}  // namespace tissueform
